"""A sensor whose zero moved while it recorded: readings that jump once, by far more than all that was read besides.

A head that was knocked, a fringe counter that lost its count, a range that was switched: from one row to the next
everything reads so much more, whatever is commanded. No model of the device has that; gain and lags that imitate it say
nothing else any more. It is taken from the readings, and said.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record, ZeroMove

Array = NDArray[np.float64]

TIMES_WHAT_IS_READ = 5.0
"""The jump, over what the readings span on either side: of a response that is so much larger nothing would be left."""
ISOLATED_ROWS = 5
"""Width of the median that single outlying readings do not pass."""
FEWEST_ROWS, FEWEST_CHANGES = 16, 3
"""On either side; one change of the command may have such a response, late."""
SAME_COMMANDS = 0.5
"""Of the smaller span of the commands on either side that lies within the other one."""
LAGS = 8
"""Means of the command over 1, 2, 4, ... rows, beside which the height is fitted."""


def without_zero_move(record: Record) -> Record:
    """Return a record whose readings go on as before its sensor's zero moved; the same one where it did not."""
    found = None if record.zero_move is not None else zero_move(record)
    if found is None:
        return record
    later = np.arange(len(record)) >= found.row
    steady = np.where(later, record.displacement_um - found.height_um, record.displacement_um)
    return replace(record, displacement_um=steady, zero_move=found)


def zero_move(record: Record) -> ZeroMove | None:
    """Return where the zero of a sensor moved; None where it did not, or where the command may be the cause."""
    rows = np.flatnonzero(np.isfinite(record.displacement_um))
    read_um = record.displacement_um[rows]
    if rows.size < 2 * FEWEST_ROWS:
        return None
    even = np.lib.stride_tricks.sliding_window_view(np.pad(read_um, ISOLATED_ROWS // 2, mode="edge"), ISOLATED_ROWS)
    smoothed = np.median(even, axis=1)
    begin = int(np.argmax(np.abs(np.diff(smoothed)))) + 1
    if not FEWEST_ROWS <= begin <= rows.size - FEWEST_ROWS:
        return None
    low, high = sorted((smoothed[:begin], smoothed[begin:]), key=lambda x: float(x[0]))
    apart = float(high.min() - low.max())
    if apart <= TIMES_WHAT_IS_READ * max(float(np.ptp(low)), float(np.ptp(high))):
        return None
    row = int(rows[begin])
    if not _commands_are_alike(record.voltage_V[:row], record.voltage_V[row:]):
        return None
    return ZeroMove(row, _height_um(record.voltage_V, rows, read_um, begin))


def _commands_are_alike(before_V: Array, after_V: Array) -> bool:
    """Return whether much the same was commanded on both sides, changed often enough to show every response."""
    if any(np.count_nonzero(np.diff(x)) < FEWEST_CHANGES for x in (before_V, after_V)):
        return False
    shared = min(before_V.max(), after_V.max()) - max(before_V.min(), after_V.min())
    return bool(shared >= SAME_COMMANDS * min(np.ptp(before_V), np.ptp(after_V)))


def _height_um(voltage_V: Array, rows: NDArray[np.intp], read_um: Array, begin: int) -> float:
    """Return the height of a jump, fitted beside means of the command over several times: by absolute values."""
    total = np.concatenate([[0.0], np.cumsum(voltage_V - voltage_V[0])])
    ends = rows + 1
    means = [(total[ends] - total[np.maximum(ends - 2**k, 0)]) / 2.0**k for k in range(LAGS)]
    columns = np.stack([np.ones(rows.size), (np.arange(rows.size) >= begin).astype(float), *means], axis=1)
    weights = np.ones(rows.size)
    found = np.zeros(columns.shape[1])
    for _ in range(20):
        found, *_ = np.linalg.lstsq(columns * weights[:, None], read_um * weights, rcond=None)
        left = np.abs(read_um - columns @ found)
        weights = 1.0 / np.sqrt(np.maximum(left, 1e-3 * float(np.median(left)) + 1e-300))
    return float(found[1])
