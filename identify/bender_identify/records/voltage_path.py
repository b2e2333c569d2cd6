"""The path of the voltage between and before the rows of a record."""

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Drive
from bender_identify.settings import InputHold
from bender_loop.records.acting_voltage import acting_V
from bender_loop.records.between_rows import PIECES_PER_ROW, followed
from bender_loop.records.record import Record

Array = NDArray[np.float64]

LONGEST_LEAD_ROWS = 5_000
ROUGH_PIECES_PER_ROW = 2
"""A rough simulation follows a smooth voltage in this many straight pieces between two rows."""


def even_times(step_s: float, count: int) -> Array:
    """Return 0, step, 2 step, ... (count,)."""
    return np.arange(count, dtype=np.float64) * np.float64(step_s)


def acting_voltage(record: Record, input_hold: InputHold) -> Array:
    """Return the voltage (n,) that is acting when each row is read."""
    command_s = record.time_s if record.command_time_s is None else record.command_time_s
    return acting_V(record.time_s, command_s, record.voltage_V, linear=input_hold != "hold")


def drive_of(
    record: Record, input_hold: InputHold, settled_time_s: Array | None, in_motion: bool, rough: bool = False
) -> tuple[Drive, int]:
    """Return the drive of a record and the number of its rows that stand before those of the record.

    Args:
        record: the record.
        input_hold: how the voltage runs between two rows.
        settled_time_s: made-up times of an untimed record, whose rows are settled pairs; None for a timed one.
        in_motion: begin with a lead-in, the voltage reflected at its first point, v(-t) = 2 v(0) - v(t), within the
            voltages that the record reaches.
        rough: follow a smooth voltage in fewer pieces.
    """
    if settled_time_s is not None:
        row_s = float(settled_time_s[1] - settled_time_s[0])
        return Drive(np.append(-row_s, settled_time_s + 0.99 * row_s), settled_time_s, record.voltage_V), 1
    command_s = record.time_s if record.command_time_s is None else record.command_time_s
    lead = min(len(record) - 1, LONGEST_LEAD_ROWS) if in_motion else 0
    time_s = np.concatenate([2.0 * record.time_s[0] - record.time_s[lead:0:-1], record.time_s])
    acts_s = np.concatenate([2.0 * command_s[0] - command_s[lead:0:-1], command_s])
    voltage_V = np.concatenate([2.0 * record.voltage_V[0] - record.voltage_V[lead:0:-1], record.voltage_V])
    low, high = min(0.0, record.voltage_V.min()), max(0.0, record.voltage_V.max())
    voltage_V = np.clip(voltage_V, low, high)
    if input_hold == "smooth":
        acts_s, voltage_V = followed(acts_s, voltage_V, ROUGH_PIECES_PER_ROW if rough else PIECES_PER_ROW)
    return Drive(time_s, acts_s, voltage_V, linear=input_hold != "hold"), lead
