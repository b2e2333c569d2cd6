"""The supply's current: it stays at its limit while a limited supply charges the bender.

A lag lets the current decay after a step, from a peak in proportion to the step. A limit holds it level, for a time in
proportion to the step, and lets it go at once when the voltage has arrived. Level for several rows and gone within one
is a limit; the time that it was level, known to a row on either side, is that of the voltage's way.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bender_inference.witnesses.read_back import Array, meter_noise
from bender_loop.records.record import Record

FEWEST_LEVEL = 3
"""Rows at the limit after a step: two samples of a decay may be alike, three that end at once are not."""
CLEAR_NOISES, ALIKE_NOISES, ALIKE = 20.0, 5.0, 0.05
"""A limit stands so far above what is drawn at rest; readings within so many noises, or such a part, are alike."""
GONE = 0.1
"""Of the limit: what is still drawn once the voltage has arrived, through the bender's leakage."""
LONGER = 1.5
"""A step so many times as high as one that reached the limit must reach it too."""
LEAST_NOISE_A = 1e-9
LEAST_STEP = 0.02
"""Of the commands' range: lower steps are not looked at."""


def slew_range_V_per_s(records: Sequence[Record]) -> tuple[float, float] | None:
    """Return the slowest and the fastest slew rate that the currents of all records allow; None where none is shown."""
    low, high, some = 0.0, math.inf, False
    for one in records:
        for found in _ranges(one):
            if found is None:
                return None
            low, high, some = max(low, found[0]), min(high, found[1]), True
    return (low, high) if some and low < high else None


def _ranges(record: Record) -> Iterator[tuple[float, float] | None]:
    """Yield what every upward step allows; None for a step that should have reached the limit and did not."""
    if record.current_A is None or not np.isfinite(record.current_A).all():
        return
    volts, current_A = record.voltage_V, record.current_A
    noise_A = meter_noise(volts, current_A, LEAST_NOISE_A)
    steps = np.diff(volts)
    jumps = np.flatnonzero(steps > LEAST_STEP * np.ptp(volts)) + 1
    changed = np.append(np.flatnonzero(steps != 0.0) + 1, len(record))
    shown: list[tuple[float, tuple[float, float]]] = []
    not_shown: list[float] = []
    for j in jumps:
        end = int(changed[np.searchsorted(changed, j, side="right")])
        height_V = float(steps[j - 1])
        drawn_A = current_A[j:end] - current_A[j - 1]
        level = _level_rows(drawn_A, noise_A)
        if level is not None:
            shown.append((height_V, _rates(record, int(j), level, height_V)))
        elif drawn_A.size > FEWEST_LEVEL:
            not_shown.append(height_V)
    if shown and max(not_shown, default=0.0) >= LONGER * min(height_V for height_V, _ in shown):
        yield None
        return
    for _, found in shown:
        yield found


def _level_rows(drawn_A: Array, noise_A: float) -> tuple[int, int] | None:
    """Return the first and the last row at the limit; None where the current is not level or does not end at once."""
    if drawn_A.size < FEWEST_LEVEL + 2:
        return None
    limit_A = float(drawn_A.max())
    at = np.flatnonzero(drawn_A >= limit_A - max(ALIKE_NOISES * noise_A, ALIKE * limit_A))
    first, last = int(at[0]), int(at[-1])
    after = drawn_A[last + 2 :]  # the row between may have been read while the current fell
    is_level = at.size >= FEWEST_LEVEL and last - first + 1 == at.size and first <= 1
    is_over = after.size > 0 and bool(np.all(after <= GONE * limit_A + ALIKE_NOISES * noise_A))
    return (first, last) if limit_A >= CLEAR_NOISES * noise_A and is_level and is_over else None


def _rates(record: Record, jump: int, level: tuple[int, int], height_V: float) -> tuple[float, float]:
    """Return the slowest and the fastest rate: when within its row each current was read is not known."""
    time_s = record.time_s
    acting_s = time_s if record.command_time_s is None else record.command_time_s
    first, last = jump + level[0], jump + level[1]
    longest_s = time_s[min(last + 2, len(record) - 1)] - acting_s[jump]
    return height_V / float(longest_s), height_V / float(time_s[last] - time_s[first + 1])
