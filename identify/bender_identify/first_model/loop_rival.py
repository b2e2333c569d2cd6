"""A loop that does not depend on time, as the rival of every linear structure.

In a narrow band, whatever shifts the phase looks like a lag, a mode or a delay: a loop of hysteresis or dry friction
too. Play operators beside a gain (Prandtl-Ishlinskii; Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989,
doi:10.1007/978-3-642-61302-9) have the loop without any time; they are linear in their weights. Where they simulate
unseen blocks better than the best linear structure, the phase of the records is no evidence of dynamics. Which
structure is still needed behind the plays is found by trying each, with all its times shortened by one factor.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bender_identify.first_model.fit import HIGHEST_PER_ROW, Array, FitTask, Mask
from bender_identify.first_model.structures import Structure
from bender_plant.model import Model
from bender_plant.parameter import ModelError

HYSTERESIS = "rate_independent_hysteresis"
PLAYS, NARROWEST, WIDEST = 10, 0.01, 0.45
"""Widths over the span of the input, from a jump at each reversal to nearly half: a wider play never engages."""
FACTORS = tuple(float(x) for x in np.geomspace(1.0, 0.01, 9))
"""By which the times of a structure are shortened."""


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


def _left(task: FitTask, fold: Fold, structure: Structure, values: tuple[float, ...]) -> list[Array] | None:
    """Return what plays before a structure leave of the judged rows (n,) of every record, NaN elsewhere."""
    columns = _columns(task, structure, values)
    if columns is None:
        return None
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


def _columns(task: FitTask, structure: Structure, values: tuple[float, ...]) -> list[Array] | None:
    """Return the reading of a gain of 1, alone and with each play, over the rows of all records."""
    span_V = max(float(np.ptp(x.acting_V)) for x in task.experiments)
    widths_V = [float(x) for x in span_V * np.geomspace(NARROWEST, WIDEST, PLAYS)]
    try:
        plain = structure.model(values)
        models = [plain, *(_with_play(plain, x) for x in widths_V)]
        return [np.concatenate(task.readings(model)) for model in models]
    except (ModelError, ArithmeticError):
        return None


def _with_play(model: Model, width_V: float) -> Model:
    return model.with_block(HYSTERESIS, form="plays", thresholds_V=(width_V,), weights_um_per_V=(1.0,))
