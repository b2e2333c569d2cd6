"""Whether the reading still moves with what is expected of it: a dead sensor is no effect of the device."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ADVICE = "the reading does not move: is the sensor connected?"
NO_READING = "no reading comes: is the sensor connected?"
PART, CERTAIN = 0.2, 3.0
"""Of what is expected, below which a reading does not move, and deviations by which that is certain."""
FAR = 0.25
"""Of the stroke, that is expected to be moved: play stands as long as that after a reversal."""
BY_CHANCE, MOVED = 1e-3, 6.0
"""How likely equal readings are by chance at most, and deviations of the noise that are expected to be moved."""
MOVES = 0.5
"""Of what is expected, from which on a reading moves."""
SILENT, TIMES = 64, 4
"""Rows without a reading that are more than a loss, and times the longest loss of the training record."""


def is_still(measured_um: Array, expected_um: Array, noise_um: float, stroke_um: float, repeats: float) -> bool:
    """Return whether readings stand while the device is expected to move.

    Args:
        measured_um: (n,) since a change, NaN for a lost one.
        expected_um: (n,).
        noise_um: deviation of the noise.
        stroke_um: peak to peak, of the training record.
        repeats: part of its readings that equal the one before.
    """
    seen = np.isfinite(measured_um)
    y, x = measured_um[seen], expected_um[seen]
    if y.size < 2:
        return False
    if np.ptp(y) == 0.0:
        return bool(repeats ** (y.size - 1) < BY_CHANCE and np.ptp(x) > MOVED * noise_um)
    slope, std = _slope(y, x, noise_um)
    return bool(np.ptp(x) > FAR * stroke_um) and abs(slope) + CERTAIN * std < PART


def moves(measured_um: Array, expected_um: Array, noise_um: float, stroke_um: float) -> bool:
    """Return whether readings move as far as the device is expected to, which it is."""
    seen = np.isfinite(measured_um)
    y, x = measured_um[seen], expected_um[seen]
    return y.size > 1 and bool(np.ptp(x) > FAR * stroke_um) and abs(_slope(y, x, noise_um)[0]) > MOVES


def _slope(y: Array, x: Array, noise_um: float) -> tuple[float, float]:
    """Return the slope of readings (n,) over what is expected of them, and its deviation."""
    x, y = x - x.mean(), y - y.mean()
    square = max(float(x @ x), 1e-300)
    slope = float(x @ y) / square
    spread = max(noise_um, float(np.std(y - slope * x)))
    return slope, spread / float(np.sqrt(square))


def repeats_of(readings_um: Array) -> float:
    """Return which part of readings equal the one before."""
    seen = readings_um[np.isfinite(readings_um)]
    return float(np.mean(np.diff(seen) == 0.0)) if seen.size > 1 else 0.0


def silent_after(readings_um: Array) -> int:
    """Return after how many rows without a reading a sensor is silent, by the record (n,) while all was well."""
    lost = np.concatenate([[False], np.isnan(readings_um), [False]])
    edges = np.flatnonzero(np.diff(lost.astype(np.int8)))
    longest = int(np.max(edges[1::2] - edges[::2])) if edges.size else 0
    return max(SILENT, TIMES * longest)
