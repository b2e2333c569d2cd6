"""The rival of every hysteresis: a gain with a first-order lag, w' = a w + b u + c u'.

At one frequency it draws a loop too. Where it does about as well as an operator, the record cannot distinguish them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bender_identify.fitting.candidate import Candidate
from bender_identify.records.experiment import Experiment
from bender_identify.regression.equation_search import equation_of, zero_of
from bender_identify.regression.rates import regression_of
from bender_identify.regression.sparse_fit import least_squares
from bender_plant.model import Model

TERMS = ("w", "u", "u'")
TITLE = "first-order lag, linear"
SLOWEST = 1e-3
"""A start whose lag is not stable is replaced by one of this rate in units of the record's own."""


def fit_lag(
    experiments: Sequence[Experiment], base: Model, start: NDArray[np.float64] | None = None
) -> Candidate | None:
    """Fit the lag by the simulated readings; None where the record is untimed or no regression gives it a start.

    Args:
        experiments: records made ready.
        base: gives everything but the material.
        start: coefficients to start from; None finds them by regression.
    """
    if start is None:
        start = _start(experiments)
        if start is None:
            return None
    found = equation_of(TERMS, start, experiments, base)
    best = found.fit.values
    return replace(found, id="first_order_lag", title=TITLE, refit=lambda others: fit_lag(others, base, best) or found)


def _start(experiments: Sequence[Experiment]) -> NDArray[np.float64] | None:
    regression = regression_of(TERMS, experiments, zero_of(experiments), "weak")
    if regression is None or not all(x.timed for x in experiments):
        return None
    found = dict(
        zip(regression.terms, least_squares(regression, tuple(range(len(regression.terms)))).tolist(), strict=True)
    )
    start = np.array([found.get(term, 0.0) for term in TERMS])
    if start[0] >= 0.0:
        start[0] = -SLOWEST * abs(float(regression.scales[0]))
    return start
