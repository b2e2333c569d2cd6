"""Coarse readings: are they multiples of one step, and of which?

Readings on a lattice of step q have the same phase of 2 pi r / q, every one; noise would spread it. The step is looked
for among the distances between readings that occur, so a fine lattice that a file's decimals make is found as well,
and told apart by its size beside the noise.
"""

import numpy as np
from numpy.typing import NDArray

COHERENT = 0.98
# of the readings, so many may be off the lattice: a frame that was misread is
OFF_THE_LATTICE = 0.03
FEWEST_READINGS = 20
STOOD_ROWS = 5
# of what the readings span
SAME = 1e-9


def coherence(readings_um: NDArray[np.float64], step_um: float) -> float:
    """Return the length of the mean phasor of the readings at a step: 1 on a lattice, near 0 off it."""
    return float(np.abs(np.mean(np.exp(2j * np.pi * readings_um / step_um))))


def lattice_step_um(readings_um: NDArray[np.float64]) -> float:
    """Return the step of the lattice on which the readings lie, 0 where they lie on none.

    The answer may be the step of the file's decimals; compare it with the noise.
    """
    readings = readings_um[np.isfinite(readings_um)]
    if readings.size < FEWEST_READINGS:
        return 0.0
    values, times = np.unique(np.round(readings, 9), return_counts=True)
    # one value may have come in two that differ in the last digits of a sum
    first = np.flatnonzero(np.diff(values, prepend=-np.inf) > SAME * np.ptp(readings))
    values, times = values[first], np.add.reduceat(times, first)
    if times[times > 1].sum() > 0.5 * readings.size:
        # what was read once may have been misread
        values = values[times > 1]
    if values.size < 3 or values.size > readings.size / 2:
        return 0.0
    distances = np.diff(values)
    step = float(np.median(distances[distances < 1.5 * distances.min()]))
    # the distances that occur most are one step each: refine it on the whole span
    counts = np.round((values - values[0]) / step)
    refined = float(np.sum(counts * (values - values[0])) / np.sum(counts**2))
    off = np.abs(readings / refined - np.round(readings / refined))
    near = readings[off <= np.quantile(off, 1.0 - OFF_THE_LATTICE)]
    return refined if coherence(near, refined) > COHERENT else 0.0


def jitter_um(readings_um: NDArray[np.float64], command_V: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far readings lie from the line through both neighbours, shape (m,): noise and steps, little else.

    While the command stands, where it does so long enough: a moving tip crosses steps.
    """
    jitter = np.abs(np.diff(readings_um, 2))
    stands = np.diff(command_V) == 0.0
    count = readings_um.size
    if count > STOOD_ROWS:
        rows = np.lib.stride_tricks.sliding_window_view(stands, STOOD_ROWS).all(axis=1)
        # the last row of each stretch that stands
        last = np.flatnonzero(rows) + STOOD_ROWS
        if last.size >= FEWEST_READINGS:
            return jitter[last - 2]
    return jitter
