"""What a model leaves of a record that it was not fitted to."""

from typing import TYPE_CHECKING

import numpy as np

from bender_compiled.simulation import Simulator
from bender_inference.records.initial_motion import started
from bender_inference.records.observations import observe
from bender_loop.records.initial_motion import starts_at_rest

if TYPE_CHECKING:
    from bender_loop.records.record import Record
    from bender_plant.model import Model

FINDS_ITS_STATE = 50
"""Rows of the beginning that are not counted, but a tenth of a record at most."""


def left_about_mean_um(model: "Model", record: "Record", hold: str = "hold", *, untimed: bool = False) -> float:
    """Return what a model leaves of a record about its mean: an offset belongs to the record.

    Args:
        model: calibrated.
        record: of the same device.
        hold: how the command ran between the rows, as `diagnose --input-hold` has it.
        untimed: the times of the record are only an order.
    """
    seen = observe(record, hold in ("linear", "smooth"), untimed, hold == "smooth")
    if not starts_at_rest(record.voltage_V):
        seen = started(model, record, seen)
    left = record.displacement_um - Simulator(seen.drive, coarser=1.0).run(model).reading_um
    return float(np.nanstd(left[min(FINDS_ITS_STATE, left.size // 10) :]))
