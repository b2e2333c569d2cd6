"""Readings at the end of a sensor's range: they stand at one value, the highest or lowest of all, without their noise.

A converter that is at its end gives one number, whatever it is shown; so does a tank that overflows, seen through one.
Anything that only holds still (a device at rest, a play that is crossed) keeps the noise of its sensor.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record

Array = NDArray[np.float64]

FEWEST_ROWS = 5
"""In a row, at one value: with the noise of all other rows that is chance in none of a thousand records."""
CHANCE = 1e-3
LIKE_NOISE = 0.5
"""Of third differences, each scaled to white noise, over second ones: a smooth course without noise has far less."""
TYPICAL = 0.6745
"""The median size of a standard normal number."""


@dataclass(frozen=True, slots=True)
class EndOfRange:
    """Readings that stand at an end.

    Attributes:
        side: of the range.
        value: at which they stand, in the unit of the record.
        rows: how many do.
        first: row of the first of the longest stretch, counted from 0.
    """

    side: Literal["above", "below"]
    value: float
    rows: int
    first: int


def ends_of_range(record: Record) -> list[EndOfRange]:
    """Return where readings stand at the end of the sensor's range while the command moves; empty as a rule."""
    read, volts = record.displacement_um, record.voltage_V
    seen = np.isfinite(read)
    if int(seen.sum()) <= 2 * FEWEST_ROWS:
        return []
    highest, lowest = float(np.max(read[seen])), float(np.min(read[seen]))
    found = (_end(read, volts, "above", highest), _end(read, volts, "below", lowest))
    return [x for x in found if x is not None]


def _end(read: Array, volts: Array, side: Literal["above", "below"], value: float) -> EndOfRange | None:
    there = read == value
    first, length = _longest_stretch(there)
    if length < FEWEST_ROWS or np.ptp(volts[first : first + length]) == 0.0:
        return None
    noise, step = _noise(np.where(there, np.nan, read)), _finest_step(read)
    if not 0.0 < step < noise:
        return None
    # of two rows with this noise, that they are alike
    alike = min(1.0, step / (noise * math.sqrt(4.0 * math.pi)))
    if read.size * alike ** (length - 1) > CHANCE:
        return None
    return EndOfRange(side, value, int(there.sum()), first)


def _longest_stretch(there: NDArray[np.bool_]) -> tuple[int, int]:
    """Return the first row and the length of the longest stretch of rows that are there."""
    turns = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(np.int8)))
    begins, ends = turns[::2], turns[1::2]
    if begins.size == 0:
        return 0, 0
    k = int(np.argmax(ends - begins))
    return int(begins[k]), int(ends[k] - begins[k])


def _noise(read: Array) -> float:
    """Return the deviation of the noise of single readings; 0 where the course is smooth, or has none."""
    second, third = (_typical(np.diff(read, order)) / math.sqrt(scale) for order, scale in ((2, 6.0), (3, 20.0)))
    return third if third > LIKE_NOISE * second else 0.0


def _typical(differences: Array) -> float:
    known = differences[np.isfinite(differences)]
    return float(np.median(np.abs(known))) / TYPICAL if known.size else 0.0


def _finest_step(read: Array) -> float:
    """Return the smallest distance of two readings that differ: one step of the sensor, or less."""
    apart = np.diff(np.unique(read[np.isfinite(read)]))
    return float(apart.min()) if apart.size else 0.0
