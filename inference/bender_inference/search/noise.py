"""The noise floor of what a hypothesis leaves, and how large that is.

A fit to coarse readings counts only how far the simulation lies beyond the step in which the tip must have been. Of
that little is left, and it is no noise: where the tip stands near the edge of a step, the noise of the sensor pushes
readings to the next one, always the same way.
"""

import math
from collections.abc import Sequence

import numpy as np

from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.output_error import Fitted
from bender_inference.records.noise import end_of_rests, floor_ratio_limit, least_noise_um, noise_floor_um
from bender_inference.records.observations import Array, Mask
from bender_inference.records.spectrum import without_line
from bender_loop.records.outliers import FAR


def noise_of(fitted: Fitted, problem: FitProblem) -> float:
    """Return the noise floor that the residuals of all records show, in the unit of the readings."""
    return math.sqrt(_mean(_floor_squares(fitted, problem), [int(x.searched.sum()) for x in problem.observations]))


def shares_of_noise(fitted: Fitted, problem: FitProblem) -> list[float]:
    """Return the square of every record's own noise over that of all of them: records may differ in their sensors."""
    if len(problem.observations) == 1:
        return [1.0]
    squares = _floor_squares(fitted, problem)
    mean = _mean(squares, [int(x.searched.sum()) for x in problem.observations])
    return [x / mean if mean > 0.0 else 1.0 for x in squares]


def floor_square_um2(problem: FitProblem, noise_um: float) -> float:
    """Return the square that no model could go below: the noise, and the steps of coarse readings."""
    steps = [(2.0 * x.half_step_um) ** 2 / 12.0 for x in problem.observations]
    return noise_um**2 + sum(steps) / len(steps)


def floor_limit(problem: FitProblem, confidence: float, *, judged: bool = True) -> float:
    """Return how many times the square of the floor the mean square of noise alone may be.

    Args:
        problem: the records.
        confidence: that noise alone is below.
        judged: on the rows of choices; else on all that fits and choices see.
    """
    rows = sum(int((x.judging if judged else x.searched).sum()) for x in problem.observations)
    return floor_ratio_limit(problem.all_rows, max(rows, 1), 1.0 - confidence)


def residual_square_um2(problem: FitProblem, fitted: Fitted, *, judged: bool = False) -> float:
    """Return the mean square of the readings as they are, steps of coarse ones included.

    Args:
        problem: the records.
        fitted: the hypothesis.
        judged: on the rows of choices alone; else on all that fits and choices see.
    """
    return square_on(problem, fitted, [x.judging if judged else x.searched for x in problem.observations])


def square_on(problem: FitProblem, fitted: Fitted, counted: Sequence[Mask]) -> float:
    """Return the mean square of the readings as they are on the rows that count; inf where there is no simulation."""
    left = as_read(problem, fitted)
    if left is None:
        return math.inf
    rows = sum(int(x.sum()) for x in counted)
    return sum(float(np.sum(r[x] ** 2)) for r, x in zip(left, counted, strict=True)) / max(rows, 1)


def energy_at_floor(
    fitted: Fitted, problem: FitProblem, noise_um: float, confidence: float, *, everywhere: bool = False
) -> bool:
    """Return whether the mean square of the residual is no larger than that of noise alone, by chance included.

    It has to be on the few rows that choices are made on, which no fit has seen. Without effects there is nothing that
    follows its own rows: it has to be on all of them too, where less is chance. Every record has a noise of its own,
    and its own share of the rows.
    """
    every = shares_of_noise(fitted, problem)
    for judged in (True, False) if everywhere or not fitted.hypothesis.parts else (True,):
        rows = [int((x.judging if judged else x.searched).sum()) for x in problem.observations]
        noise = noise_um**2 * sum(x * n for x, n in zip(every, rows, strict=True)) / max(sum(rows), 1)
        most = floor_limit(problem, confidence, judged=judged) * floor_square_um2(problem, math.sqrt(noise))
        if residual_square_um2(problem, fitted, judged=judged) > most:
            return False
    return True


def extremes_at_floor(fitted: Fitted, problem: FitProblem, noise_um: float) -> bool:
    """Return whether no reading is left as far off as an outlying one: isolated ones have been set aside before."""
    rows = zip(fitted.residuals, problem.observations, shares_of_noise(fitted, problem), strict=True)
    return all(
        float(np.max(np.abs(r[x.searched]), initial=0.0))
        <= FAR * math.sqrt(floor_square_um2(problem, noise_um * math.sqrt(share)))
        for r, x, share in rows
    )


def _floor_squares(fitted: Fitted, problem: FitProblem) -> list[float]:
    rows = zip(fitted.residuals, problem.observations, strict=True)
    left = [
        (without_line(x.time_s, np.nan_to_num(r), x.searched), x.searched, end_of_rests(x.course_V)[x.places])
        for r, x in rows
    ]
    least = (least_noise_um(x.measured_um[x.searched], steps=x.half_step_um == 0.0) for x in problem.observations)
    return [max(noise_floor_um(*x), y) ** 2 for x, y in zip(left, least, strict=True)]


def _mean(squares: list[float], rows: list[int]) -> float:
    return sum(s * n for s, n in zip(squares, rows, strict=True)) / sum(rows)


def as_read(problem: FitProblem, fitted: Fitted) -> Sequence[Array] | None:
    """Return what a fit leaves of the readings as they are, (n,) of every record; None where it cannot be simulated.

    The residuals of a fit to coarse readings are what lies beyond their steps.
    """
    if not any(x.half_step_um > 0.0 for x in problem.observations):
        return fitted.residuals
    readings = problem.readings(fitted.hypothesis)
    if readings is None:
        return None
    gain, offsets = fitted.calibration.gain, fitted.calibration.offsets_um
    return [
        x.measured_um - gain * y - offset for x, y, offset in zip(problem.observations, readings, offsets, strict=True)
    ]
