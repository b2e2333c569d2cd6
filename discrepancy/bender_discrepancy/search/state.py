"""What a search found, and how large what it leaves is.

A fit to coarse readings counts only how far the simulation lies beyond the step in which the tip must have been. Of
that little is left, and it is no noise: where the tip stands near the edge of a step, the noise of the sensor pushes
readings to the next one, always the same way. So a small effect may seem to explain it. In the readings as they are it
vanishes beside the steps.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bender_discrepancy.fitting.criterion import Yardstick, autocorrelation_time, price
from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.journal import current_journal
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.records.noise import least_noise_um, noise_floor_um
from bender_discrepancy.records.observations import Array
from bender_discrepancy.records.spectrum import without_line


@dataclass(frozen=True, slots=True, eq=False)
class Ranked:
    """A hypothesis that was tried on top of another, with the criterion's difference to it (negative: better)."""

    fitted: Fitted
    difference: float


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What a search found.

    Attributes:
        problem: what everything was fitted to, with the readings that count at the end.
        base: the model as given, recalibrated.
        best: the hypothesis that stands at the end.
        noise_um: noise floor.
        yardstick: what differences were weighed with at the end.
        ranking: hypotheses tried at the first step, best first.
        last_ranking: hypotheses tried at the step that decided the last effect, best first.
        steps: the best hypothesis after every step, base first.
        led: effects that were among the leaders of any step.
        stopped: a further step would have gone beyond the budget.
    """

    problem: FitProblem
    base: Fitted
    best: Fitted
    noise_um: float
    yardstick: Yardstick
    ranking: tuple[Ranked, ...] = ()
    last_ranking: tuple[Ranked, ...] = ()
    steps: tuple[Fitted, ...] = ()
    led: frozenset[str] = frozenset()
    stopped: bool = False


def rms_um(fitted: Fitted, problem: FitProblem, held: bool = True) -> float:
    """Return the rms of a hypothesis on the rows that choices are made on, or on those of the fit."""
    rows = sum(int((x.judging if held else x.training).sum()) for x in problem.observations)
    square = fitted.held_square if held else fitted.training_square
    return math.sqrt(square / max(rows, 1))


def square_um2(fitted: Fitted, problem: FitProblem) -> float:
    """Return the mean square of a hypothesis over all rows that fits and choices see."""
    return (fitted.training_square + fitted.held_square) / max(problem.all_rows, 1)


def noise_of(fitted: Fitted, problem: FitProblem) -> float:
    """Return the noise floor that the residuals of all records show: the root mean square of theirs, by their rows."""
    return math.sqrt(_mean(_floor_squares(fitted, problem), [int(x.searched.sum()) for x in problem.observations]))


def shares_of_noise(fitted: Fitted, problem: FitProblem) -> list[float]:
    """Return the square of every record's own noise over that of all of them: records may differ in their sensors."""
    if len(problem.observations) == 1:
        return [1.0]
    squares = _floor_squares(fitted, problem)
    mean = _mean(squares, [int(x.searched.sum()) for x in problem.observations])
    return [x / mean if mean > 0.0 else 1.0 for x in squares]


def _floor_squares(fitted: Fitted, problem: FitProblem) -> list[float]:
    rows = zip(fitted.residuals, problem.observations, strict=True)
    left = [(without_line(x.time_s, np.nan_to_num(r), x.searched), x.searched) for r, x in rows]
    least = (least_noise_um(x.measured_um[x.searched], steps=x.half_step_um == 0.0) for x in problem.observations)
    return [max(noise_floor_um(*x), y) ** 2 for x, y in zip(left, least, strict=True)]


def _mean(squares: list[float], rows: list[int]) -> float:
    return sum(s * n for s, n in zip(squares, rows, strict=True)) / sum(rows)


def work_so_far(problem: FitProblem) -> int:
    """Return the sub-steps simulated so far, those of the interrupted search that goes on included."""
    journal = current_journal()
    return problem.work_substeps if journal is None else journal.work_so_far(problem.work_substeps)


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
