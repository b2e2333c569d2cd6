"""Outlying frames: isolated readings far from both neighbours, as a tracker leaves when it takes dirt for the tip.

Signal is not isolated: after a step the residual rings for several frames, and under a changing command it is smooth.
Rows right after a jump of the command are never called outlying, whatever they hold.
"""

import numpy as np
from numpy.typing import NDArray

from .noise import deviation
from .observations import Array, Mask, Observations

FAR = 6.0
AFTER_A_JUMP_ROWS = 3


def after_jumps(voltage_V: Array) -> Mask:
    """Return the rows that follow a jump of the command, by as many rows as its ringing may last."""
    changes = np.abs(np.diff(voltage_V, prepend=0.0))
    moving = changes[changes > 0.0]
    jump = changes > max(5.0 * float(np.median(changes)), 0.02 * float(np.ptp(voltage_V)) if moving.size else np.inf)
    near = np.zeros(voltage_V.size, dtype=bool)
    for lag in range(AFTER_A_JUMP_ROWS + 1):
        near[lag:] |= jump[: voltage_V.size - lag]
    return near


def neighbourhood_um(residual: Array, rows: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return for every usable row the median of its four neighbours and how far they spread."""
    values = residual[rows]
    padded = np.pad(values, 2, mode="edge")
    around = np.stack([padded[0:-4], padded[1:-3], padded[3:-1], padded[4:]])
    return np.median(around, axis=0), np.ptp(around, axis=0)


def outlying(observations: Observations, residual: Array, noise_um: float) -> Mask:
    """Return the rows whose residual stands alone: far from neighbours that agree among themselves."""
    rows = np.nonzero(observations.usable)[0]
    found = np.zeros(residual.size, dtype=bool)
    if rows.size < 8:
        return found
    middle, spread = neighbourhood_um(residual, rows)
    apart = np.abs(residual[rows] - middle)
    bulk = deviation(residual[rows] - middle)
    alone = apart > FAR * max(noise_um, bulk)
    alone &= apart > 2.0 * spread
    found[rows[alone]] = True
    return found & ~after_jumps(observations.drive.voltage_V)
