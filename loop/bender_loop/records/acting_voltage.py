"""The voltage that acts while a row of a record is read, and the direction of its last change."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def acting_V(row_time_s: Array, command_time_s: Array, voltage_V: Array, linear: bool = False) -> Array:
    """Return the voltage that acts when each row is read, before a command of the same instant does.

    Args:
        row_time_s: (n,) instants of the readings.
        command_time_s: (m,) instants from which the commands act; before the first one 0 V acts.
        voltage_V: (m,) commands.
        linear: the voltage runs straight from command to command instead of being held.

    Returns:
        (n,) volts. Under `linear` a row that is read where a line begins is read at its first voltage.
    """
    if linear:
        return np.interp(row_time_s, command_time_s, voltage_V, left=0.0)
    command = np.searchsorted(command_time_s, row_time_s, side="left") - 1
    return np.where(command < 0, 0.0, voltage_V[np.maximum(command, 0)])


def direction(voltage_V: Array) -> Array:
    """Return the sign of the last change of a voltage row by row; the first rows take that of the first change.

    A voltage that never changes counts as rising.
    """
    signs = np.sign(np.diff(voltage_V, prepend=voltage_V[:1]))
    moving = np.flatnonzero(signs)
    if moving.size == 0:
        return np.ones_like(signs)
    last = np.searchsorted(moving, np.arange(signs.size), side="right") - 1
    return signs[moving[np.maximum(last, 0)]]
