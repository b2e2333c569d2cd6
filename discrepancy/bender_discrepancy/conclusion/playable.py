"""The drive of a compiled simulation as a record that an FMU can be played: both then read the same instants."""

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Drive
from bender_loop.records.record import Record

Array = NDArray[np.float64]

# a straight run that begins after 0 V jumps there: the 0 V ends by this much before
INSTANT_S = 1e-9


def playable(drive: Drive) -> tuple[Record, NDArray[np.intp]]:
    """Return a record with a row at every reading and every command, and which of its rows are the readings.

    The plant is at 0 V before the first command acts.
    """
    if not drive.linear and np.array_equal(drive.row_time_s, drive.command_time_s):
        times = drive.row_time_s
        return Record(times, drive.voltage_V, np.full_like(times, np.nan)), np.arange(times.size)
    instants = [drive.row_time_s, drive.command_time_s]
    first = float(drive.command_time_s[0])
    if drive.linear and drive.row_time_s[0] < first:
        instants.append(np.array([first - INSTANT_S]))
    times = np.unique(np.concatenate(instants))
    voltage = _line(drive, times) if drive.linear else _held(drive, times)
    record = Record(times, voltage, np.full_like(times, np.nan))
    return record, np.searchsorted(times, drive.row_time_s)


def _held(drive: Drive, times: Array) -> Array:
    command = np.searchsorted(drive.command_time_s, times, side="right") - 1
    return np.where(command < 0, 0.0, drive.voltage_V[np.maximum(command, 0)])


def _line(drive: Drive, times: Array) -> Array:
    return np.interp(times, drive.command_time_s, drive.voltage_V, left=0.0)
