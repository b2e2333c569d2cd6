"""A loop that does not depend on time, as the rival of every linear structure.

In a narrow band, whatever shifts the phase looks like a lag, a mode or a delay: a loop of hysteresis or dry friction
too. Play operators beside a gain (Prandtl-Ishlinskii; Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989,
doi:10.1007/978-3-642-61302-9) have the loop without any time; they are linear in their weights. Where they simulate
held-out rows better than the best linear structure, the phase of the records is no evidence of dynamics.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bender_identify.first_model.fit import Array, FitTask, Mask
from bender_identify.first_model.structures import Structure
from bender_plant.parameter import ModelError

HYSTERESIS = "rate_independent_hysteresis"
PLAYS = 10
"""Widths, evenly spread up to half the span of the input: a wider play never engages."""


@dataclass(frozen=True, slots=True)
class LoopRival:
    """A gain and plays, fitted to the fitted rows.

    Attributes:
        numbers: weights and gain.
        held_out_rms: what it leaves on held-out rows, in the unit of the readings.
    """

    numbers: int
    held_out_rms: float


def loop_rival(task: FitTask, seen: Sequence[Mask], held_out: Sequence[Mask]) -> LoopRival | None:
    """Fit gain, plays and an offset of every record by linear least squares; None where none can be simulated.

    Args:
        task: the records.
        seen: rows that are fitted, for every record.
        held_out: rows that the fit is judged on.
    """
    columns = _columns(task)
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
    return LoopRival(len(columns), float(np.sqrt(np.mean(left**2))))


def _columns(task: FitTask) -> list[Array] | None:
    """Return the reading of a gain of 1, alone and with each play, over the rows of all records."""
    span_V = max(float(np.ptp(x.acting_V)) for x in task.experiments)
    gain = Structure().model(())
    plays = [
        gain.with_block(
            HYSTERESIS, form="plays", thresholds_V=(0.5 * span_V * k / (PLAYS + 1),), weights_um_per_V=(1.0,)
        )
        for k in range(1, PLAYS + 1)
    ]
    try:
        return [np.concatenate(task.readings(model)) for model in (gain, *plays)]
    except (ModelError, ArithmeticError):
        return None
