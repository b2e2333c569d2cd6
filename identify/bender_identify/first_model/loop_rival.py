"""A loop that does not depend on time, as the rival of every linear structure.

In a narrow band, whatever shifts the phase looks like a lag, a mode or a delay: a loop of hysteresis or dry friction
too. Play operators beside a gain (Prandtl-Ishlinskii; Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989,
doi:10.1007/978-3-642-61302-9) have the loop without any time; they are linear in their weights. Where they simulate
unseen blocks better than the best linear structure, the phase of the records is no evidence of dynamics. Which
structure is still needed behind the plays is found by trying each, with all its times shortened by one factor.

A loop hides dynamics from a linear fit, so the numbers that this leaves are no more than a start. Where a loop is
there, simple structures are fitted behind plays that lean, of an actuator in use, beside a curve: near enough to a
Preisach operator that a lag is distinguished from a delay (variable projection, Golub and Pereyra 1973).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bender_identify.first_model.fit import (
    HIGHEST_PER_ROW,
    SLOPE_STEP,
    Array,
    FitTask,
    Mask,
    from_search,
    to_search,
)
from bender_identify.first_model.structures import Structure
from bender_plant.model import Model
from bender_plant.parameter import ModelError

HYSTERESIS = "rate_independent_hysteresis"
PLAYS, NARROWEST, WIDEST = 10, 0.01, 0.45
"""Widths over the span of the input, from a jump at each reversal to nearly half: a wider play never engages."""
FACTORS = tuple(float(x) for x in np.geomspace(1.0, 0.01, 9))
"""By which the times of a structure are shortened."""
LEANING_PLAYS = 6
FIRST_EVALUATIONS, LATER_EVALUATIONS = 8, 3
"""Of a fit behind leaning plays, in the first fold and in the others, slopes apart."""
FAR = 1e3
"""Residual of what cannot be simulated."""
RINGS_PER_ROW, RING_DAMPING = (0.1, 0.2, 0.35), (0.1, 0.4)
"""Frequencies, in periods per row, and damping ratios that a mode sets out with."""


Fold = tuple[Sequence[Mask], Sequence[Mask]]
"""Rows that are fitted and rows that the fit is judged on, for every record."""


@dataclass(frozen=True, slots=True, eq=False)
class LoopRival:
    """Plays before a linear structure.

    Attributes:
        structure: behind the plays; a gain alone has no time.
        values: its numbers, from the first fold.
        residuals: (n,) for every record, each row by weights that have not seen its block; NaN where none is judged.
    """

    structure: Structure
    values: tuple[float, ...]
    residuals: tuple[Array, ...]


def loop_rival(
    task: FitTask, folds: Sequence[Fold], structure: Structure, values: Sequence[tuple[float, ...]]
) -> LoopRival | None:
    """Fit gain, plays and an offset of every record by linear least squares, with shortened times of a structure.

    Args:
        task: the records.
        folds: rows that are fitted and judged, in turn.
        structure: behind the plays.
        values: its numbers without plays, as every fold found them.

    Returns:
        The plays with the factor that leaves least on the held-out rows of the first fold; None where none can be
        simulated.
    """
    factors = [x for x in FACTORS if _can_be_seen(task, structure, _shortened(structure, values[0], x))]
    # without any number every factor is the same
    factors = factors if structure.names else [1.0]
    first = {x: _left(task, folds[0], structure, _shortened(structure, values[0], x)) for x in factors}
    left = {x: rows for x, rows in first.items() if rows is not None}
    if not left:
        return None
    factor = min(left, key=lambda x: _mean_square(left[x]))
    residuals = left[factor]
    for fold, of_fold in zip(folds[1:], values[1:], strict=True):
        others = _left(task, fold, structure, _shortened(structure, of_fold, factor))
        if others is None:
            return None
        residuals = [np.where(np.isfinite(r), r, known) for r, known in zip(others, residuals, strict=True)]
    return LoopRival(structure, _shortened(structure, values[0], factor), tuple(residuals))


def behind_leaning_plays(
    task: FitTask, folds: Sequence[Fold], structure: Structure, known: Sequence[LoopRival]
) -> LoopRival | None:
    """Fit the numbers of a structure behind plays that lean; None where it cannot be simulated.

    Args:
        task: the records.
        folds: rows that are fitted and judged, in turn.
        structure: behind the plays.
        known: structures behind plays, with numbers to set out from.
    """
    values: tuple[float, ...] | None = None
    residuals = [np.full(x.time_s.size, np.nan) for x in task.experiments]
    for fold in folds:
        begun = _starts(task, structure, known) if values is None else [values]
        seen = (fold[0], fold[0])
        tried = [(x, _left(task, seen, structure, x, leaning=True)) for x in begun]
        alive = [(_mean_square(left), x) for x, left in tried if left is not None]
        if not alive:
            return None
        most = FIRST_EVALUATIONS if values is None else LATER_EVALUATIONS
        found = _fitted(task, fold, structure, min(alive)[1], most) if structure.names else ()
        left = _left(task, fold, structure, found, leaning=True)
        if left is None:
            return None
        values = values or found
        residuals = [np.where(np.isfinite(r), r, k) for r, k in zip(left, residuals, strict=True)]
    return LoopRival(structure, values or (), tuple(residuals))


def without_plays(task: FitTask, folds: Sequence[Fold], loop: LoopRival) -> list[Array] | None:
    """Return the residual (n,) of every record on unseen rows with the numbers of a loop's structure, but no plays.

    A linear fit may have stopped short of them.
    """
    columns = [np.concatenate(task.readings(loop.structure.model(loop.values)))]
    found = [np.full(x.time_s.size, np.nan) for x in task.experiments]
    for fold in folds:
        left = _left_of(task, fold, columns)
        if left is None:
            return None
        found = [np.where(np.isfinite(r), r, k) for r, k in zip(left, found, strict=True)]
    return found


def _starts(task: FitTask, structure: Structure, known: Sequence[LoopRival]) -> list[tuple[float, ...]]:
    """Return numbers that a structure sets out with: by how much others are late in all, all of it or in halves."""
    late_s = sorted(_late_s(x) for x in known if x.structure.names)
    late = late_s[len(late_s) // 2] if late_s else task.delay_unit_s
    if structure.modes:
        return [
            (x / task.delay_unit_s, damping, *([late] if structure.delay else []))
            for x in RINGS_PER_ROW
            for damping in RING_DAMPING
        ]
    count = structure.lags + structure.delay
    return [(late / count,) * count] if count else [()]


def _late_s(loop: LoopRival) -> float:
    """Return by how much a structure is late in all: its lags, its delay, twice the damping over the frequency."""
    found, damping = 0.0, 0.0
    for name, value in reversed(list(zip(loop.structure.names, loop.values, strict=True))):
        if name.startswith("damping"):
            damping = value
        elif name.startswith("frequency"):
            found += damping / (np.pi * value)
        elif name.startswith(("time_constant", "delay")):
            found += value
    return found


def _fitted(
    task: FitTask, fold: Fold, structure: Structure, values: tuple[float, ...], most_evaluations: int
) -> tuple[float, ...]:
    """Return the numbers of a structure that leave least of the fitted rows of a fold behind leaning plays."""
    from scipy.optimize import least_squares

    seen = (fold[0], fold[0])

    def residual(point: Array) -> Array:
        left = _left(task, seen, structure, from_search(structure, point, task), leaning=True)
        if left is None:
            return np.full(sum(int(x.sum()) for x in fold[0]), FAR)
        return np.concatenate([r[m] for r, m in zip(left, fold[0], strict=True)])

    point = to_search(structure, values, task)
    steps = SLOPE_STEP / np.maximum(1.0, np.abs(point))
    found = least_squares(residual, point, max_nfev=most_evaluations, diff_step=steps, x_scale=1.0)
    return from_search(structure, found.x, task)


def _mean_square(residuals: Sequence[Array]) -> float:
    return float(np.nanmean(np.concatenate(list(residuals)) ** 2))


def _can_be_seen(task: FitTask, structure: Structure, values: Sequence[float]) -> bool:
    """Return whether no mode lies so far above the rate of the rows that no reading shows it."""
    highest = HIGHEST_PER_ROW / task.delay_unit_s
    pairs = zip(structure.names, values, strict=True)
    return all(x <= highest for name, x in pairs if name.startswith("frequency"))


def _shortened(structure: Structure, values: Sequence[float], factor: float) -> tuple[float, ...]:
    """Return the numbers of a structure with all times shortened: lags and delays, and the periods of its modes."""
    times = ("time_constant", "delay")
    return tuple(
        x * factor if name.startswith(times) else x / factor if name.startswith("frequency") else x
        for name, x in zip(structure.names, values, strict=True)
    )


def _left(
    task: FitTask, fold: Fold, structure: Structure, values: tuple[float, ...], *, leaning: bool = False
) -> list[Array] | None:
    """Return the residual (n,) of every record with plays before a structure, NaN where no row is judged."""
    columns = _columns(task, structure, values, leaning=leaning)
    return None if columns is None else _left_of(task, fold, columns)


def _left_of(task: FitTask, fold: Fold, columns: Sequence[Array]) -> list[Array] | None:
    """Return the residual (n,) of every record after a linear fit of columns, NaN where no row is judged."""
    readings = [x.measured_um for x in task.experiments]
    sizes = [y.size for y in readings]
    offsets = [np.repeat(np.eye(len(sizes))[k], sizes) for k in range(len(sizes))]
    table, measured = np.column_stack([*offsets, *columns]), np.concatenate(readings)
    fitted, judged = (np.concatenate(list(x)) for x in fold)
    if np.count_nonzero(fitted) <= table.shape[1] or not judged.any():
        return None
    weights = np.linalg.lstsq(table[fitted], measured[fitted], rcond=None)[0]
    everywhere = np.where(judged, measured - table @ weights, np.nan)
    return np.split(everywhere, np.cumsum(sizes)[:-1])


def _columns(task: FitTask, structure: Structure, values: tuple[float, ...], *, leaning: bool) -> list[Array] | None:
    """Return the reading of a gain of 1, alone and with each play, over the rows of all records."""
    volts = np.concatenate([x.acting_V for x in task.experiments])
    span_V = max(float(np.ptp(x.acting_V)) for x in task.experiments)
    widths_V = [float(x) for x in span_V * np.geomspace(NARROWEST, WIDEST, LEANING_PLAYS if leaning else PLAYS)]
    try:
        plain = structure.model(values)
        if leaning:
            models = [plain, *_with_leaning_parts(plain, widths_V, float(volts[np.argmax(np.abs(volts))]))]
        else:
            models = [plain, *(_with_play(plain, x) for x in widths_V)]
        return [np.concatenate(task.readings(model)) for model in models]
    except (ModelError, ArithmeticError):
        return None


def _with_play(model: Model, width_V: float) -> Model:
    return model.with_block(HYSTERESIS, form="plays", thresholds_V=(width_V,), weights_um_per_V=(1.0,))


def _with_leaning_parts(model: Model, widths_V: Sequence[float], reached_V: float) -> list[Model]:
    """Return a model with each play of an actuator in use and with its square, and with the powers of a curve."""
    plays = [
        model.with_block(
            HYSTERESIS, form="plays", thresholds_V=(x,), weights_um_per_V=(1.0 - power,),
            quadratic_um_per_V2=(power / abs(reached_V),), reached_V=reached_V,
        )
        for x in widths_V
        for power in (0.0, 1.0)
    ]  # fmt: skip
    curve = {"reversible_quadratic_um_per_V2": reached_V**-1, "reversible_cubic_um_per_V3": reached_V**-2}
    return [*plays, *(model.with_block(HYSTERESIS, form="plays", **{name: x}) for name, x in curve.items())]
