"""Fits by simulation error: every free number of a hypothesis at once, gain and offsets solved for inside."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from bender_compiled.parallel_map import parallel_map
from bender_inference.fitting.fit_problem import Calibration, FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.journal import current_journal
from bender_inference.fitting.scans.jumps import middle_of_equal_fits, minimise_in_jumps
from bender_inference.records.observations import Array

STEP = 2e-3
TOLERANCE = 1e-5
MANY, WORTH = 10, 5e-3
"""So many numbers are often nearly alike, and a fit of them creeps on at the cost of as many simulations a step. Where
structure is left, a step that takes less than this part off the square is the last one: no choice looks that closely.
"""
BY_SQUARE = 2
"""What `least_squares` says where a step took little off the square."""
TURNS_OF_JUMPS = 2
"""So often numbers by which the square falls in jumps are moved, and the others fitted again."""
# part of a step's change of the residual by which slopes may miss it before they are simulated anew
FORETOLD = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """A hypothesis with its best numbers.

    Attributes:
        hypothesis: with the numbers found.
        calibration: gain and offsets that go with them.
        residuals: measured minus simulated for every record, in um, NaN where lost.
        training_square: sum of squares over the training rows.
        held_square: sum of squares over the held-out rows.
        covariance: of the coordinates of the free numbers per unit of noise variance, None where it is singular.
    """

    hypothesis: Hypothesis
    calibration: Calibration
    residuals: tuple[Array, ...]
    training_square: float
    held_square: float
    covariance: Array | None = None


def _inward(hypothesis: Hypothesis) -> Array:
    return np.array([f.inward(v) for f, v in zip(hypothesis.free, hypothesis.values(), strict=True)])


def _outward(hypothesis: Hypothesis, x: Array) -> Hypothesis:
    return hypothesis.with_values([f.outward(float(c)) for f, c in zip(hypothesis.free, x, strict=True)])


def judge(problem: FitProblem, hypothesis: Hypothesis) -> Fitted | None:
    """Return a hypothesis as it is, with gain and offsets solved for; None where it cannot be simulated."""
    readings = problem.readings(hypothesis)
    if readings is None:
        return None
    calibration = problem.calibrate(readings)
    residuals = problem.residuals(readings, calibration)
    return _fitted(problem, hypothesis, calibration, residuals, None)


def _fitted(
    problem: FitProblem,
    hypothesis: Hypothesis,
    calibration: Calibration,
    residuals: list[Array],
    covariance: Array | None,
) -> Fitted:
    return recounted(Fitted(hypothesis, calibration, tuple(residuals), math.nan, math.nan, covariance), problem)


def recounted(fitted: Fitted, problem: FitProblem) -> Fitted:
    """Return a hypothesis with its squares over the rows that count now: which do may have changed since the fit."""
    rows = list(zip(fitted.residuals, problem.observations, strict=True))
    training = sum(float(np.sum(r[x.training] ** 2)) for r, x in rows)
    held = sum(float(np.sum(r[x.judging] ** 2)) for r, x in rows)
    return replace(fitted, training_square=training, held_square=held)


def training_residual(problem: FitProblem, hypothesis: Hypothesis, roughly: bool = False) -> Array | None:
    """Return the calibrated residual on the training rows of all records."""
    readings = problem.readings(hypothesis, roughly)
    if readings is None:
        return None
    residuals = problem.residuals(readings, problem.calibrate(readings))
    return np.concatenate([r[x.training] for r, x in zip(residuals, problem.observations, strict=True)])


def fit(
    problem: FitProblem,
    hypothesis: Hypothesis,
    most_evaluations: int = 12,
    roughly: bool = False,
    known: Mapping[int, Array] | None = None,
    *,
    kept: bool = True,
    closely: bool = False,
) -> Fitted | None:
    """Fit every free number of a hypothesis from where it stands; None where it cannot be simulated there.

    Args:
        problem: the records.
        hypothesis: with the numbers to set out from.
        most_evaluations: of the residual, those for slopes apart.
        roughly: with the longer sub-steps of scans.
        known: slopes of the residual by some of the numbers, which then are not simulated: good enough for a rough fit
            of what was added to a fitted hypothesis.
        kept: in the journal of a search, from which it goes on where it was interrupted.
        closely: to the end where many numbers leave structure, too.
    """
    journal = current_journal() if kept else None
    if journal is None or not hypothesis.free:
        return _fit(problem, hypothesis, most_evaluations, roughly, known or {}, closely)
    key = journal.key(problem, hypothesis, "fit", most_evaluations, roughly, sorted(known or ()), closely)
    told = journal.recall(key)
    if told is not None:
        return _again(problem, hypothesis, told, roughly)
    fitted = _fit(problem, hypothesis, most_evaluations, roughly, known or {}, closely)
    if fitted is None:
        journal.entries[key] = {"values": None}
    else:
        covariance = None if fitted.covariance is None else fitted.covariance.tolist()
        journal.entries[key] = {"values": list(fitted.hypothesis.values()), "covariance": covariance}
    return fitted


def _again(problem: FitProblem, hypothesis: Hypothesis, told: Mapping[str, Any], roughly: bool) -> Fitted | None:
    """Return the result of a fit whose numbers are told: its residuals are simulated again."""
    if told["values"] is None:
        return None
    best = hypothesis.with_values(told["values"])
    readings = problem.readings(best, roughly)
    if readings is None:
        return None
    calibration = problem.calibrate(readings)
    covariance = None if told["covariance"] is None else np.array(told["covariance"])
    return _fitted(problem, best, calibration, problem.residuals(readings, calibration), covariance)


def _fit(
    problem: FitProblem,
    hypothesis: Hypothesis,
    most_evaluations: int,
    roughly: bool,
    known: Mapping[int, Array],
    closely: bool,
) -> Fitted | None:
    try:
        return _fit_from(problem, hypothesis, most_evaluations, roughly, known, closely)
    except (np.linalg.LinAlgError, FloatingPointError, OverflowError):
        # numbers in which nothing can be solved for: a hypothesis that failed
        return None


def _fit_from(
    problem: FitProblem,
    hypothesis: Hypothesis,
    most_evaluations: int,
    roughly: bool,
    known: Mapping[int, Array],
    closely: bool,
) -> Fitted | None:
    free = hypothesis.free
    start = training_residual(problem, hypothesis, roughly)
    if start is None or not free:
        return judge(problem, hypothesis)
    if not np.all(np.isfinite(start)):
        return None
    course = _Course(problem, hypothesis, roughly, known, 1e3 * (np.abs(start) + 1.0), (_inward(hypothesis), start))
    x, slopes = _to_the_least(course, most_evaluations, closely)
    best = _outward(hypothesis, x)
    readings = problem.readings(best, roughly)
    if readings is None:
        return None
    calibration = problem.calibrate(readings)
    return _fitted(problem, best, calibration, problem.residuals(readings, calibration), _covariance(slopes))


def _covariance(slopes: Array) -> Array | None:
    try:
        return np.asarray(np.linalg.inv(slopes.T @ slopes), dtype=np.float64)
    except np.linalg.LinAlgError:
        return None


@dataclass(slots=True, eq=False)
class _Course:
    """The residual on the training rows over the coordinates of all free numbers.

    Attributes:
        problem: the records.
        hypothesis: whose numbers are free.
        roughly: with the longer sub-steps of scans.
        known: slopes by some of the numbers.
        worst: (n,) residual of what cannot be simulated.
        last: coordinates that were simulated last, and their residual.
    """

    problem: FitProblem
    hypothesis: Hypothesis
    roughly: bool
    known: Mapping[int, Array]
    worst: Array
    last: tuple[Array, Array]

    def bounds(self) -> tuple[Array, Array]:
        """Return the lowest and the highest coordinate of every number."""
        free = self.hypothesis.free
        low = np.array([f.inward(f.low) if not f.log or f.low > 0.0 else -math.inf for f in free])
        return low, np.array([f.inward(f.high) for f in free])

    def one(self, x: Array) -> Array:
        """Return the residual at some coordinates."""
        found = training_residual(self.problem, _outward(self.hypothesis, x), self.roughly)
        return self.worst if found is None else found

    def residual(self, x: Array) -> Array:
        """Return the same; the last one is not simulated again."""
        if not np.array_equal(x, self.last[0]):
            self.last = (x.copy(), self.one(x))
        return self.last[1]

    def slopes(self, x: Array, here: Array, numbers: Sequence[int]) -> Array:
        """Return the slopes (n, k) by some of the numbers, where the residual is known."""
        high = self.bounds()[1]

        def column(k: int) -> Array:
            if k in self.known:
                return self.known[k]
            step = STEP if x[k] + STEP < high[k] else -STEP
            moved = x.copy()
            moved[k] += step
            return (self.one(moved) - here) / step

        return np.stack(parallel_map(column, numbers), axis=1)


def _to_the_least(course: _Course, most_evaluations: int, closely: bool) -> tuple[Array, Array]:
    """Return the coordinates at which the square is least, and the slopes there by all numbers.

    A number by which the square falls in jumps stands while the others follow their slopes: its own would lead astray,
    and the trust in theirs would be lost. In turn it is moved while they stand.
    """
    free = course.hypothesis.free
    low, high = course.bounds()
    x = np.clip(_inward(course.hypothesis), low + 1e-9, high - 1e-9)
    smooth, jumping = ([k for k, f in enumerate(free) if f.jumps is jumps] for jumps in (False, True))
    slopes = np.empty((course.worst.size, 0))
    for turn in range(1 + TURNS_OF_JUMPS):
        if smooth:
            x, slopes = _along_slopes(course, x, smooth, most_evaluations, closely)
        if not jumping or course.roughly or turn == TURNS_OF_JUMPS:
            break
        moved, gained = _minimise_in_jumps(course, x, jumping)
        x = moved
        if not gained:
            break
    if not jumping:
        return x, slopes
    x = x if course.roughly else _centre_in_jumps(course, x, jumping)
    by_all = np.empty((course.worst.size, len(free)))
    by_all[:, smooth] = slopes
    by_all[:, jumping] = course.slopes(x, course.residual(x), jumping)
    return x, by_all


def _along_slopes(
    course: _Course, x: Array, numbers: Sequence[int], most_evaluations: int, closely: bool
) -> tuple[Array, Array]:
    """Return all coordinates with some of them where the square is least, and the slopes by these."""
    whole, (low, high) = x.copy(), course.bounds()

    def placed(some: Array) -> Array:
        every = whole.copy()
        every[numbers] = some
        return every

    slopes = _Slopes(
        lambda some: course.residual(placed(some)), lambda some, here: course.slopes(placed(some), here, numbers)
    )
    bounds = low[numbers], high[numbers]
    found = _least_squares(course.problem, slopes, whole[numbers], bounds, most_evaluations, closely)
    return placed(found.x), found.jac


def _minimise_in_jumps(course: _Course, x: Array, numbers: Sequence[int]) -> tuple[Array, bool]:
    """Return the coordinates with some numbers moved in jumps, and whether that took anything off the square."""
    first = square = _square(course.residual(x))
    for k in numbers:
        square_at = _square_over(course, x, k)
        value, square = minimise_in_jumps(course.hypothesis.free[k].outward(float(x[k])), square, square_at)
        x = _with_number(course, x, k, value)
    return x, square < (1.0 - TOLERANCE) * first


def _centre_in_jumps(course: _Course, x: Array, numbers: Sequence[int]) -> Array:
    """Return the coordinates with some numbers in the middle of the range that fits equally well.

    Within it the log-likelihood falls by less than half the logarithm of the readings that count, the price of one
    number (Schwarz 1978, doi:10.1214/aos/1176344136). A coarse reading counts where it lies beyond its step.
    """
    for k in numbers:
        left = course.residual(x)
        rows = max(int(np.count_nonzero(left)), 1)
        most = _square(left) * rows ** (1.0 / rows)
        value = course.hypothesis.free[k].outward(float(x[k]))
        x = _with_number(course, x, k, middle_of_equal_fits(value, most, _square_over(course, x, k)))
    return x


def _square_over(course: _Course, x: Array, number: int) -> Callable[[float], float]:
    """Return the square over the value of one number, inf beyond its bounds."""
    free = course.hypothesis.free[number]

    def square_at(value: float) -> float:
        within = free.low <= value <= free.high
        return _square(course.one(_with_number(course, x, number, value))) if within else math.inf

    return square_at


def _with_number(course: _Course, x: Array, number: int, value: float) -> Array:
    moved = x.copy()
    moved[number] = course.hypothesis.free[number].inward(value)
    return moved


def _square(left: Array) -> float:
    return float(left @ left)


def _least_squares(
    problem: FitProblem, slopes: "_Slopes", x0: Array, bounds: tuple[Array, Array], most_evaluations: int, closely: bool
) -> Any:
    """Return where the square is least: to the end for few numbers, where little structure is left, or if asked to."""
    options: dict[str, Any] = {"jac": slopes, "x_scale": "jac", "bounds": bounds, "xtol": TOLERANCE, "gtol": 1e-12}
    enough = TOLERANCE if closely or x0.size < MANY else WORTH
    found = least_squares(slopes.residual, x0, max_nfev=most_evaluations, ftol=enough, **options)
    left = most_evaluations - found.nfev
    if enough == TOLERANCE or found.status != BY_SQUARE or left < 1 or _is_structure(problem, found.fun):
        return found
    # the first evaluation is the last one of before
    return least_squares(slopes.residual, found.x, max_nfev=left + 1, ftol=TOLERANCE, **options)


def _is_structure(problem: FitProblem, residual: Array) -> bool:
    """Return whether most of a residual on the training rows is alike from one row to the next.

    Half of the mean square of its differences is that of what is not (von Neumann 1941, doi:10.1214/aoms/1177731677).
    """
    ends = np.cumsum([int(x.training.sum()) for x in problem.observations])[:-1]
    jumps = sum(float(np.sum(np.diff(x) ** 2)) for x in np.split(residual, ends))
    return 0.5 * jumps < 0.5 * float(residual @ residual)


@dataclass(slots=True)
class _Slopes:
    """The slopes of a residual, simulated anew only where those at hand have foretold the last step badly.

    Where they foretold it well they are mended by what it showed: Broyden's update (1965, doi:10.2307/2003941), which
    costs no simulation.
    """

    residual: Callable[[Array], Array]
    simulated: Callable[[Array, Array], Array]
    x: Array | None = None
    here: Array | None = None
    slopes: Array | None = None

    def __call__(self, x: Array) -> Array:
        here = self.residual(x)
        if self.x is None or self.here is None or self.slopes is None:
            self.slopes = self.simulated(x, here)
        else:
            step, changed = x - self.x, here - self.here
            missed = changed - self.slopes @ step
            if float(missed @ missed) > FORETOLD**2 * float(changed @ changed):
                self.slopes = self.simulated(x, here)
            else:
                self.slopes = self.slopes + np.outer(missed, step) / max(float(step @ step), 1e-300)
        self.x, self.here = x.copy(), here
        return self.slopes
