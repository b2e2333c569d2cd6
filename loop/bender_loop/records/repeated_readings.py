"""Readings that a logger took twice: its sensor gives new ones less often than there are rows.

Between two readings that differ by many steps of the last digit, one that equals the one before to the last digit is
no new one. By chance that is as rare as any other small difference. A repeated reading says where the device was some
rows ago, and looks like a swing at half the rate of the rows.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FAR = 50
"""Steps of the last digit; readings on both sides that differ by as many show that the device, or the noise, moves."""
FEWEST = 20
"""Repeats; a few may be chance."""
ALIKE = 0.95
"""Of the readings that are repeated or not while the device moves: so many stand in as many rows, or one more."""
MOVING_PART = 0.5
"""Of all rows, how many bring another command: a reading under a held one may stand."""
LONGEST = 16
"""Rows that a reading stands in; what stands for longer rests."""


def without_repeats(record: Record) -> Record:
    """Return a record without repeated readings, each lost but for its first row; the same one where none are."""
    if 2 * np.count_nonzero(np.diff(record.voltage_V)) < 2 * MOVING_PART * len(record):
        return record
    repeats = _repeats(record.displacement_um)
    if not np.any(repeats):
        return record
    readings = np.where(repeats, np.nan, record.displacement_um)
    return replace(record, displacement_um=readings, repeats=int(repeats.sum()))


def _repeats(readings: Array) -> Mask:
    """Return which readings (n,) repeat the one before."""
    found = np.zeros(readings.size, dtype=np.bool_)
    rows = np.flatnonzero(np.isfinite(readings))
    values = readings[rows]
    steps = np.abs(np.diff(values))
    if rows.size < 2 * FEWEST or not np.any(steps > 0.0):
        return found
    # few readings have no neighbours a digit apart; any two of them are soon nearer
    digit = float(np.min(np.diff(np.unique(values))))
    # readings that differ from both neighbours, and the rows in which they stand
    starts = np.flatnonzero(np.concatenate([[True], steps > 0.0]))
    lengths = np.diff(np.append(starts, values.size))
    far = np.concatenate([[False], steps[starts[1:] - 1] >= FAR * digit, [False]])
    moving = far[:-1] & far[1:] & (lengths <= LONGEST)
    if not np.any(moving):
        return found
    usual = int(np.median(lengths[moving]))
    alike = np.isin(lengths[moving], (usual - 1, usual)), np.isin(lengths[moving], (usual, usual + 1))
    if usual < 2 or np.sum(lengths[moving] - 1) < FEWEST or max(np.mean(x) for x in alike) < ALIKE:
        return found
    for start, length in zip(starts.tolist(), lengths.tolist(), strict=True):
        found[rows[start + 1 : start + min(length, LONGEST)]] = True
    return found
