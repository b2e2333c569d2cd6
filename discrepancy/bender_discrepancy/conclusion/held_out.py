"""What a fit leaves of the rows that no fit and no choice saw."""

import numpy as np

from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.output_error import Fitted


def held_square_um2(fitted: Fitted, problem: FitProblem) -> float:
    """Return the mean square on the held-out rows that count now: readings may have been set aside since the fit."""
    left = [r[x.reporting] for r, x in zip(fitted.residuals, problem.observations, strict=True)]
    rows = np.concatenate(left)
    return float(np.mean(rows**2)) if rows.size else 0.0
