"""A loop that does not depend on time, as the rival of every linear structure.

In a narrow band, whatever shifts the phase looks like a lag, a mode or a delay: a loop of hysteresis or dry friction
too. Play operators beside a gain (Prandtl-Ishlinskii; Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989,
doi:10.1007/978-3-642-61302-9) have the loop without any time; they are linear in their weights. Where they simulate
held-out rows better than the best linear structure, the phase of the records is no evidence of dynamics. How far the
structure is still needed beside the plays is found by shortening all its times by one factor.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bender_identify.first_model.fit import Array, FitTask, Mask
from bender_identify.first_model.structures import Structure
from bender_plant.model import Model
from bender_plant.parameter import ModelError

HYSTERESIS = "rate_independent_hysteresis"
PLAYS, NARROWEST, WIDEST = 10, 0.01, 0.45
"""Widths over the span of the input, from a jump at each reversal to nearly half: a wider play never engages."""
FACTORS = tuple(float(x) for x in np.geomspace(1.0, 0.01, 9))
"""By which the times of a structure are shortened."""


@dataclass(frozen=True, slots=True, eq=False)
class LoopRival:
    """Plays before a linear structure, fitted to the fitted rows.

    Attributes:
        structure: behind the plays; a gain alone has no time.
        values: its numbers.
        numbers: of the whole: weights, gain, the factor of the times.
        held_out_rms: what it leaves on held-out rows, in the unit of the readings.
        residuals: (n,) for every record, NaN where a row is not held out.
    """

    structure: Structure
    values: tuple[float, ...]
    numbers: int
    held_out_rms: float
    residuals: tuple[Array, ...]


def loop_rival(task: FitTask, seen: Sequence[Mask], held_out: Sequence[Mask]) -> LoopRival | None:
    """Fit gain, plays and an offset of every record by linear least squares; None where none can be simulated.

    Args:
        task: the records.
        seen: rows that are fitted, for every record.
        held_out: rows that the fit is judged on.
    """
    return _fitted(task, seen, held_out, Structure(), ())


def with_times(
    task: FitTask,
    seen: Sequence[Mask],
    held_out: Sequence[Mask],
    loop: LoopRival,
    structure: Structure,
    values: Sequence[float],
    is_better: Callable[[LoopRival, LoopRival], bool],
) -> LoopRival:
    """Return the plays before a structure with shortened times where that is better than the plays alone.

    Args:
        task: the records.
        seen: rows that are fitted, for every record.
        held_out: rows that the fit is judged on.
        loop: the plays alone.
        structure: that the records would support without plays.
        values: its numbers.
        is_better: whether held-out rows favour the second.
    """
    tried = [_fitted(task, seen, held_out, structure, _shortened(structure, values, x)) for x in FACTORS]
    found = [x for x in tried if x is not None]
    best = min(found, key=lambda x: x.held_out_rms, default=loop)
    return best if is_better(loop, best) else loop


def _shortened(structure: Structure, values: Sequence[float], factor: float) -> tuple[float, ...]:
    """Return the numbers of a structure with all times shortened: lags and delays, and the periods of its modes."""
    times = ("time_constant", "delay")
    return tuple(
        x * factor if name.startswith(times) else x / factor if name.startswith("frequency") else x
        for name, x in zip(structure.names, values, strict=True)
    )


def _fitted(
    task: FitTask, seen: Sequence[Mask], held_out: Sequence[Mask], structure: Structure, values: tuple[float, ...]
) -> LoopRival | None:
    columns = _columns(task, structure, values)
    if columns is None:
        return None
    readings = [x.measured_um for x in task.experiments]
    sizes = [y.size for y in readings]
    offsets = [np.repeat(np.eye(len(sizes))[k], sizes) for k in range(len(sizes))]
    table, measured = np.column_stack([*offsets, *columns]), np.concatenate(readings)
    fitted, judged = np.concatenate(list(seen)), np.concatenate(list(held_out))
    if np.count_nonzero(fitted) <= table.shape[1] or not judged.any():
        return None
    weights = np.linalg.lstsq(table[fitted], measured[fitted], rcond=None)[0]
    left = measured[judged] - table[judged] @ weights
    numbers = len(columns) + bool(structure.names)
    everywhere = np.where(judged, measured - table @ weights, np.nan)
    residuals = tuple(np.split(everywhere, np.cumsum(sizes)[:-1]))
    return LoopRival(structure, values, numbers, float(np.sqrt(np.mean(left**2))), residuals)


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
