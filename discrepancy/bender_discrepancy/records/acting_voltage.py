"""The voltage that acts when a row is read, and its direction."""

import numpy as np

from bender_compiled.simulation import Drive
from bender_discrepancy.records.observations import Array, Mask


def acting_V(drive: Drive) -> Array:
    """Return the voltage that acts when each row is read, before that row's own command does."""
    if drive.linear:
        return np.interp(drive.row_time_s, drive.command_time_s, drive.voltage_V, left=0.0)
    command = np.searchsorted(drive.command_time_s, drive.row_time_s, side="left") - 1
    return np.where(command < 0, 0.0, drive.voltage_V[np.maximum(command, 0)])


def rising(voltage_V: Array) -> Mask:
    """Return whether the last change of a voltage was upwards; before the first one, whether that is."""
    changes = np.sign(np.diff(voltage_V, prepend=voltage_V[:1]))
    moving = np.flatnonzero(changes)
    if moving.size == 0:
        return np.ones(voltage_V.size, dtype=bool)
    last = np.searchsorted(moving, np.arange(voltage_V.size), side="right") - 1
    return changes[moving[np.maximum(last, 0)]] > 0.0
