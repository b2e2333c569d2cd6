"""Where a fit of one more effect should set out: values that promise most, found without fitting.

The answer to an amplitude is nearly proportional to it, so one small trial tells its best value; for scales each
start is tried; delay, quantisers, hum and a second mode have scans of their own (`scans`).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import nnls

from bender_effects.form import FAINTEST, Form, Free, Values
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.standing import Standing
from bender_inference.records.observations import Array, Mask, have_same_zero

FAINT = 0.25
"""Of the squared residual: an effect of half its size, since most of the residual may be noise."""
COARSEST, FINEST = 0.3, 0.5
"""From one start to a smaller one: beyond half a decade they lie in different valleys; within an octave in the same."""


@dataclass(frozen=True, slots=True)
class Start:
    """Values to set out from and the sum of squares on the training rows that they promise."""

    values: Values
    square: float


def readings_columns(problem: FitProblem, readings: list[Array]) -> Array:
    """Return readings of the training rows, centred as the offsets that are solved for leave them."""
    parts = [y[x.training] for y, x in zip(readings, problem.observations, strict=True)]
    if have_same_zero(problem.observations):
        parts = [np.concatenate(parts)]
    return np.concatenate([y - y.mean() for y in parts])


def _column(problem: FitProblem, hypothesis: Hypothesis) -> Array | None:
    readings = problem.readings(hypothesis, roughly=True)
    return None if readings is None else readings_columns(problem, readings)


def target(problem: FitProblem) -> Array:
    """Return the measured readings of the training rows, centred record by record."""
    return readings_columns(problem, [x.measured_um for x in problem.observations])


def solved(columns: list[Array], measured: Array) -> tuple[Array, float]:
    """Return the least-squares weights of the columns and the sum of squares that is left."""
    matrix = np.stack(columns, axis=1)
    if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(measured))):
        return np.zeros(len(columns)), math.inf
    sizes = np.linalg.norm(matrix, axis=0)
    sizes[sizes == 0.0] = 1.0
    weights, *_ = np.linalg.lstsq(matrix / sizes, measured, rcond=1e-10)
    left = measured - (matrix / sizes) @ weights
    return weights / sizes, float(left @ left)


def solved_with_signs(
    columns: list[Array], measured: Array, positive: Mask, sign: float | None = None
) -> tuple[Array, float]:
    """Return what `solved` does; weights that must not be negative have the sign of the first one, or are nought.

    The sign of the first weight is that of its column's product with what was measured, where it is not given.
    """
    weights, square = solved(columns, measured)
    if sign is None:
        sign = _sign(columns[0], measured)
    if np.all(sign * weights[positive] >= 0.0):
        return weights, square
    matrix = np.stack(columns, axis=1)
    sizes = np.linalg.norm(matrix, axis=0)
    sizes[sizes == 0.0] = 1.0
    # a free weight is the difference of two that are not negative
    both = np.concatenate([sign * matrix / sizes, -(matrix / sizes)[:, ~positive] * sign], axis=1)
    found, left = nnls(both, measured)
    weights = found[: len(columns)].copy()
    weights[~positive] -= found[len(columns) :]
    return sign * weights / sizes, float(left) ** 2


def _sign(column: Array, measured: Array) -> float:
    return 1.0 if float(column @ measured) >= 0.0 else -1.0


def _fainter(
    problem: FitProblem, base: Hypothesis, form: Form, plain: Array, measured: Array
) -> dict[float, Array | None]:
    """Return values of smaller and smaller effects, until the effect is smaller than the residual, and their columns.

    Where a gap is small, the effect at every given start is larger, and no slope leads from there to the hidden value.
    """
    free = form.free[0]
    _, left = solved([plain], measured)
    columns: dict[float, Array | None] = {}
    for approach in _approaches(free):
        for value in approach:
            if not free.low <= value <= free.high:
                break
            columns[value] = column = _column(problem, base.plus(form, (value,)))
            if column is None or solved([plain], column)[1] < FAINT * left:
                break
    return columns


def _approaches(free: Free) -> list[list[float]]:
    """Return the values on either side that lead from the nearest start to where the effect vanishes, nearest first."""
    middle, starts = free.vanishes_at, sorted(set(free.starts))
    if middle is None:
        return []
    if middle == math.inf:
        return [[1.0 / x for x in _shrinking([1.0 / x for x in reversed(starts)])]]
    above, below = [x - middle for x in starts if x > middle], [middle - x for x in reversed(starts) if x < middle]
    return [[middle + x for x in _shrinking(above)], [middle - x for x in _shrinking(below)]]


def _shrinking(sizes: list[float]) -> list[float]:
    """Return the smallest of increasing sizes and smaller ones, in steps as between the first two."""
    if not sizes:
        return []
    step = min(max(sizes[0] / sizes[1], COARSEST), FINEST) if len(sizes) > 1 else FINEST
    return [sizes[0] * step**k for k in range(1 + math.ceil(math.log(FAINTEST) / -math.log(step)))]


def scan(
    problem: FitProblem, base: Hypothesis, form: Form, keep: int = 2, beside: Standing | None = None
) -> list[Start]:
    """Return the most promising starts of one form on top of a hypothesis, best first.

    Args:
        problem: the records.
        base: the hypothesis.
        form: of the effect that is added.
        keep: so many starts.
        beside: what the numbers of the hypothesis would take over; None where they stand as they are.
    """
    before = problem.readings(base, roughly=True)
    if before is None:
        return []
    measured = target(problem)
    plain = readings_columns(problem, before)
    one = form.alone().free
    searched = [k for k, free in enumerate(one) if not free.solved]
    amplitudes = [k for k, free in enumerate(form.free) if free.solved]
    found: dict[tuple[int, ...], Start] = {}
    axes = [sorted(one[k].starts) for k in searched]
    known: dict[float, Array | None] = {}
    if len(form.free) == 1 and searched and one[0].vanishes_at is not None:
        known = _fainter(problem, base, form, plain, measured)
        axes = [sorted({*one[0].starts, *known})]
    for places in product(*(range(len(axis)) for axis in axes)):
        values = [0.0] * len(one)
        for k, axis, place in zip(searched, axes, places, strict=True):
            values[k] = axis[place]
        values *= form.records
        start = _tried(problem, base, form, values, amplitudes, plain, measured, beside, known)
        if start is not None:
            found[places] = start
    best = sorted(found, key=lambda places: (not _is_valley(found, places), found[places].square))
    return [found[places] for places in best[:keep]]


def _is_valley(found: Mapping[tuple[int, ...], Start], places: tuple[int, ...]) -> bool:
    """Return whether no neighbour along an axis promises more: two starts in one valley lead a fit to one place."""
    around = ((*places[:k], place + step, *places[k + 1 :]) for k, place in enumerate(places) for step in (-1, 1))
    return all(found[x].square >= found[places].square for x in around if x in found)


def _tried(
    problem: FitProblem,
    base: Hypothesis,
    form: Form,
    values: list[float],
    amplitudes: list[int],
    plain: Array,
    measured: Array,
    beside: Standing | None,
    known: Mapping[float, Array | None],
) -> Start | None:
    def left(*columns: Array) -> list[Array]:
        return list(columns) if beside is None else [beside.without_it(x) for x in columns]

    if not amplitudes:
        tried = known[values[0]] if values[0] in known else _column(problem, base.plus(form, tuple(values)))
        if tried is None:
            return None
        column, goal = left(tried, measured)
        return Start(tuple(values), solved([column], goal)[1])
    columns = [plain]
    for k in amplitudes:
        trial = values.copy()
        # a number may set out from nought, which shows nothing of what it does
        trial[k] = form.free[k].starts[0] or form.free[k].unit
        readings = problem.readings(base.plus(form, tuple(trial)), roughly=True)
        if readings is None:
            return None
        columns.append((readings_columns(problem, readings) - plain) / trial[k])
    positive = np.array([False] + [form.free[k].low >= 0.0 for k in amplitudes])
    *columns, goal = left(*columns, measured)
    weights, square = solved_with_signs(columns, goal, positive, _sign(plain, measured))
    gain = weights[0] if abs(weights[0]) > 1e-12 else 1.0
    for k, weight in zip(amplitudes, weights[1:], strict=True):
        free = form.free[k]
        values[k] = float(np.clip(weight / gain, free.low, free.high))
    return Start(tuple(values), square)
