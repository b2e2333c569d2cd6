"""Evidence in coarse readings: what an effect changes must show in the readings themselves.

A fit to coarse readings counts only how far the simulation lies beyond the step in which the tip must have been. Of
that little is left, and it is no noise: where the tip stands near the edge of a step, the noise of the sensor pushes
readings to the next one, always the same way. So a small effect may seem to explain it. In the readings as they are it
vanishes beside the steps.
"""

import math
from collections.abc import Sequence

import numpy as np

from bender_discrepancy.fitting.criterion import autocorrelation_time, price
from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.records.observations import Array


def shows_in_the_readings(problem: FitProblem, before: Fitted, after: Fitted) -> bool:
    """Return whether the criterion, of readings as they are, favours the second hypothesis as well.

    Readings that are not coarse have been judged as they are: always True.
    """
    if all(x.half_step_um == 0.0 for x in problem.observations):
        return True
    first, second = (_left_um(problem, x) for x in (before, after))
    if first is None or second is None:
        return False
    effective = 0.0
    for left, x in zip(second, problem.observations, strict=True):
        effective += float(x.searched.sum()) / autocorrelation_time(np.nan_to_num(left), x.searched)
    gained = effective * math.log(max(_square(problem, first), 1e-300) / max(_square(problem, second), 1e-300))
    added = price(after.hypothesis.free_count, effective) - price(before.hypothesis.free_count, effective)
    return gained > added


def readings_square_um2(problem: FitProblem, fitted: Fitted, *, all_rows: bool = False) -> float:
    """Return the mean square of the readings as they are, steps of coarse ones included.

    On the rows of choices, or on all that fits and choices see.
    """
    left: Sequence[Array] | None = fitted.residuals
    if any(x.half_step_um > 0.0 for x in problem.observations):
        left = _left_um(problem, fitted)
    if left is None:
        return math.inf
    counted = [x.searched if all_rows else x.judging for x in problem.observations]
    rows = sum(int(x.sum()) for x in counted)
    return sum(float(np.sum(r[x] ** 2)) for r, x in zip(left, counted, strict=True)) / max(rows, 1)


def _square(problem: FitProblem, left: list[Array]) -> float:
    return sum(float(np.sum(r[x.searched] ** 2)) for r, x in zip(left, problem.observations, strict=True))


def _left_um(problem: FitProblem, fitted: Fitted) -> list[Array] | None:
    readings = problem.readings(fitted.hypothesis)
    if readings is None:
        return None
    gain, offsets = fitted.calibration.gain, fitted.calibration.offsets_um
    return [
        x.measured_um - gain * y - offset for x, y, offset in zip(problem.observations, readings, offsets, strict=True)
    ]
