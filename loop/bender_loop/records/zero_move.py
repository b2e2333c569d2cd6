"""A sensor whose zero moved while it recorded: readings that jump once, by far more than all that was read besides.

A head that was knocked, a fringe counter that lost its count, a range that was switched: from one row to the next
everything reads so much more, whatever is commanded. No model of the device has that; gain and lags that imitate it say
nothing else any more. It is taken from the readings, and said.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record, ZeroMove

Array = NDArray[np.float64]

BESIDE_THE_REST = 3.0
"""The jump, over the largest reading that commands do not explain: nothing else may be a third as large."""
TIMES_WHAT_IS_READ = 5.0
"""The jump, over what the readings span on either side, where the command turned too seldom to show that the device
does not jump so: of a response that is so much larger nothing would be left."""
ISOLATED_ROWS = 5
"""Width of the median that single outlying readings do not pass."""
FEWEST_ROWS, FEWEST_CHANGES = 16, 3
"""On either side; some changes up and some down."""
SAME_COMMANDS = 0.5
"""Of the smaller span of the commands on either side that lies within the other one."""
FEWEST_TURNS, TURN = 3, 0.3
"""On either side; of the command's span that counts as a turn. A valve that sticks slips at every one of them."""
AT_REST = 0.01
"""Of the command's span."""
AT_ONCE = 0.5
"""Of the jump that lies between two rows."""
ANSWERED = 5.0
"""Over the spread of readings at rest, how far these lie from where they were before the last change."""
LAGS = 8
"""Means of the command over 1, 2, 4, ... rows, beside which the height is fitted."""
ROWS_PER_NUMBER = 10
"""Of that fit, from which on what it leaves says how far commands explain the readings."""


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
    largest_um = float(np.max(np.abs(read_um), initial=0.0))
    # readings whose squares are no numbers any more are refused by whoever fits them
    if rows.size < 2 * FEWEST_ROWS or not math.isfinite(rows.size * largest_um * largest_um):
        return None
    columns = _answers_to_commands(record.voltage_V, rows)
    # a jump is one of many changes, so that these tell what the commands do
    unmoved = read_um - columns @ _least_absolute(np.diff(columns, axis=0), np.diff(read_um))
    begin = _largest_jump(unmoved)
    jump = (np.arange(rows.size) >= begin).astype(float)
    beside = np.column_stack([jump, np.ones(rows.size), columns])
    read_um = read_um - np.median(read_um)
    found = _least_absolute(beside, read_um)
    height_um, left_um = float(found[0]), read_um - beside @ found
    if abs(read_um[begin] - read_um[begin - 1]) < AT_ONCE * abs(height_um):
        return None
    if abs(height_um) <= _most_of_a_device_um(record.voltage_V, rows, read_um, left_um, begin):
        return None
    return ZeroMove(int(rows[begin]), height_um)


def _largest_jump(unmoved_um: Array) -> int:
    """Return the place behind the largest jump, single readings apart."""
    near = FEWEST_ROWS // 2
    changes = np.abs(np.diff(_smoothed(unmoved_um)))[FEWEST_ROWS - 1 : 1 - FEWEST_ROWS]
    about = FEWEST_ROWS + int(np.argmax(changes))
    # an outlying reading beside a jump moves it in the smoothed readings
    few = ISOLATED_ROWS // 2
    around = unmoved_um[about - near : about + near]
    to_low = np.abs(around - np.median(around[: near - few]))
    to_high = np.abs(around - np.median(around[near + few :]))
    costs = [float(to_low[: near + k].sum() + to_high[near + k :].sum()) for k in range(-few, few + 1)]
    return about - few + int(np.argmin(costs))


def _smoothed(read_um: Array) -> Array:
    even = np.lib.stride_tricks.sliding_window_view(np.pad(read_um, ISOLATED_ROWS // 2, mode="reflect"), ISOLATED_ROWS)
    return np.median(even, axis=1)


def _most_of_a_device_um(voltage_V: Array, rows: NDArray[np.intp], read_um: Array, left_um: Array, begin: int) -> float:
    """Return the highest jump that may be the device's own answer to its commands; inf where any may be."""
    row = int(rows[begin])
    before_V, after_V = voltage_V[:row], voltage_V[row:]
    is_told = rows.size >= ROWS_PER_NUMBER * (LAGS + 2)
    beside_rest_um = BESIDE_THE_REST * float(np.max(np.abs(_smoothed(left_um)))) if is_told else np.inf
    if not _commands_are_alike(before_V, after_V):
        return beside_rest_um if _has_come_to_rest(voltage_V, rows, read_um, begin) else np.inf
    least_V = TURN * float(np.ptp(voltage_V))
    turned = min(turns(before_V, least_V), turns(after_V, least_V))
    if turned == 0:
        return np.inf
    sides = (read_um[:begin], read_um[begin:])
    beside_sides_um = TIMES_WHAT_IS_READ * max(float(np.ptp(_smoothed(x))) for x in sides)
    return beside_sides_um if turned < FEWEST_TURNS else min(beside_rest_um, beside_sides_um)


def _commands_are_alike(before_V: Array, after_V: Array) -> bool:
    """Return whether much the same was commanded on both sides, up and down, often enough to show every response."""
    for x in (before_V, after_V):
        changes = np.diff(x)
        if np.count_nonzero(changes) < FEWEST_CHANGES or changes.min() >= 0.0 or changes.max() <= 0.0:
            return False
    shared = min(before_V.max(), after_V.max()) - max(before_V.min(), after_V.min())
    return bool(shared >= SAME_COMMANDS * min(np.ptp(before_V), np.ptp(after_V)))


def turns(command_V: Array, least_V: float) -> int:
    """Return how often a command turns around after a way of at least so much, and goes as far back."""
    count, direction, low, high = 0, 0, float(command_V[0]), float(command_V[0])
    for x in command_V.tolist():
        low, high = min(low, x), max(high, x)
        if (direction >= 0 and x < high - least_V) or (direction <= 0 and x > low + least_V):
            count += direction != 0
            direction = -1 if x < high - least_V else 1
            low = high = x
    return count


def _has_come_to_rest(voltage_V: Array, rows: NDArray[np.intp], read_um: Array, begin: int) -> bool:
    """Return whether the command rests for long before a jump, and the last change of it was answered before."""
    rest_V = AT_REST * float(np.ptp(voltage_V))
    row = int(rows[begin])
    moving = np.flatnonzero(np.abs(voltage_V[: row + 1] - voltage_V[row]) > rest_V)
    if not moving.size or row - int(moving[-1]) <= FEWEST_ROWS:
        return False
    first = int(np.searchsorted(rows, moving[-1]))
    earlier, settled = read_um[max(first - FEWEST_ROWS, 0) : first], read_um[begin - FEWEST_ROWS : begin]
    if earlier.size == 0:
        return False
    spread = float(np.ptp(settled))
    return abs(float(np.median(settled)) - float(earlier[0])) > ANSWERED * spread


def _answers_to_commands(voltage_V: Array, rows: NDArray[np.intp]) -> Array:
    """Return means of the command over several times before each of some rows, (rows, LAGS), the largest of each 1."""
    total = np.concatenate([[0.0], np.cumsum(voltage_V - voltage_V[0])])
    ends = rows + 1
    means = np.stack([(total[ends] - total[np.maximum(ends - 2**k, 0)]) / 2.0**k for k in range(LAGS)], axis=1)
    return means / np.maximum(np.abs(means).max(axis=0), 1e-300)


def _least_absolute(columns: Array, values: Array) -> Array:
    """Return the numbers of a linear fit by absolute values, which does not heed single values."""
    size = float(np.max(np.abs(values))) or 1.0
    weights = np.ones(values.size)
    found = np.zeros(columns.shape[1])
    for _ in range(20):
        found, *_ = np.linalg.lstsq(columns * weights[:, None], values / size * weights, rcond=None)
        left = np.abs(values / size - columns @ found)
        weights = 1.0 / np.sqrt(np.maximum(left, 1e-3 * float(np.median(left)) + 1e-300))
    return np.asarray(size * found, dtype=np.float64)
