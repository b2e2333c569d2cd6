"""The digits of a record: which of them mean something, and whether readings are multiples of one step.

A conversion of units changes the last digits, which must not be seen.
Readings on a lattice of step q have the same phase of 2 pi r / q, every one; noise would spread it. The step is looked
for among the distances between readings that occur, so a fine lattice that a file's decimals make is found as well,
and told apart by its size beside the noise.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record

DIGITS = 12
"""Of the span of a column; the best instruments resolve eight or nine, a double holds fifteen."""
DIGITS_OF_A_ROW = 9
"""Of the usual time between two rows."""
_EXACT = 2.0**53

COHERENT = 0.98
# of the readings, so many may be off the lattice: a frame that was misread is
OFF_THE_LATTICE = 0.03
# of records without a lattice, so many may seem to have one: two distances are soon nearly multiples of one another
LUCKIEST = 1e-4
FEWEST_READINGS = 20
STOOD_ROWS = 5
# of what the readings span
SAME = 1e-9


def printed(record: Record) -> Record:
    """Return a record with the digits of each column that an instrument could have printed.

    Volts that were written in kV and read in V differ from the volts in their last bit. A quantiser answers to that
    bit where a command lies on the edge of a step, and so does a search for the smallest of many sums.
    """
    columns: dict[str, Any] = {name: _rounded(values, name) for name, values in record.columns().items()}
    return replace(record, **columns)


def _rounded(values: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    """Return a column (n,) rounded to a decimal place; as it is where its doubles have no digits beyond that."""
    seen = values[np.isfinite(values)]
    largest = float(np.max(np.abs(seen), initial=0.0))
    if largest == 0.0:
        return values
    if name in ("time_s", "command_time_s"):
        decimals = DIGITS_OF_A_ROW - math.ceil(math.log10(float(np.median(np.diff(values)))))
    else:
        decimals = DIGITS - math.ceil(math.log10(float(np.ptp(seen)) or largest))
    if decimals > 22 or largest * 10.0**decimals > _EXACT:
        return values
    return np.round(values, decimals)


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
    if _luck((values[1:] - values[0]) / refined) > LUCKIEST:
        return 0.0
    off = np.abs(readings / refined - np.round(readings / refined))
    near = readings[off <= np.quantile(off, 1.0 - OFF_THE_LATTICE)]
    return refined if coherence(near, refined) > COHERENT else 0.0


def _luck(places: NDArray[np.float64]) -> float:
    """Return how likely values (k,) lie so near whole numbers of steps by chance; the step is fitted to one of them."""
    off = np.sort(np.abs(places - np.round(places)))[1:]
    return float(np.prod(2.0 * off))


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
