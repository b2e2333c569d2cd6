"""Outlying frames: isolated readings far from both neighbours, as a tracker leaves when it takes dirt for the tip.

Signal is not isolated: under a changing command it is smooth. Right after a jump of the command, or when a delay
brings it to the reading, the residual may ring for several frames, as high as the jump: a reading there is outlying
where it is further off than any ringing goes, or an exception among those after other jumps, in units of their height.

While the tip moves, a time stamp that is a little late is a reading that is a little off, in proportion to the way
since the row before. A search for effects is better without such rows, since its likelihood takes noise to be of one
size. The numbers of what was found are better with them: stamps are late on one side, and without the latest ones a lag
comes out too short and its deviation too small.
"""

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_MAD_TO_DEVIATION = 1.4826
FAR = 6.0
AFTER_A_JUMP_ROWS = 3
EXCEPTIONS, NORMAL_TAIL = 0.05, 1.96
"""Part of the rows, and the standard deviations beyond which it lies where they are normal."""
FEWEST_ROWS = 8
ROWS_AT_A_TIME = 1 << 17
TINY = 1e-300
OVERSHOOT = 2.0
"""Heights of a step: as far as a mode without damping goes after it."""


class Readings(Protocol):
    """Readings of a record, and the command that they answer."""

    @property
    def measured_um(self) -> Array:
        """(n,) readings, NaN where lost."""
        ...

    @property
    def usable(self) -> Mask:
        """(n,) readings that count."""
        ...

    @property
    def half_step_um(self) -> float:
        """Half the step of coarse readings, 0 for none."""
        ...

    @property
    def course_V(self) -> Array:
        """(m,) the command of every row of the record from the first of these to the last."""
        ...

    @property
    def places(self) -> NDArray[np.intp]:
        """(n,) where the readings stand among those of `course_V`."""
        ...


def deviation(values: Array) -> float:
    """Return the standard deviation of the bulk of the values (median absolute deviation)."""
    return float(_MAD_TO_DEVIATION * np.median(np.abs(values - np.median(values)))) if values.size else 0.0


def heights_after_jumps_V(voltage_V: Array, late_rows: int = 0) -> Iterator[Array]:
    """Yield for 0, 1, 2, ... rows after a jump of the command its height there, 0 elsewhere; some late ones too."""
    changes = np.abs(np.diff(voltage_V, prepend=0.0))
    moving = changes[changes > 0.0]
    least = max(5.0 * float(np.median(changes)), 0.02 * float(np.ptp(voltage_V))) if moving.size else np.inf
    heights = np.where(changes > least, changes, 0.0)
    for lag in range(min(late_rows + AFTER_A_JUMP_ROWS + 1, heights.size)):
        yield np.concatenate([np.zeros(lag), heights[: heights.size - lag]])


def neighbourhood_um(residual: Array, rows: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return for every usable row the median of its six neighbours and how far the four nearest to that spread.

    Two of the neighbours may be misread as well.
    """
    values = residual[rows]
    padded = np.pad(values, 3, mode="reflect")
    middle, spread = np.empty_like(values), np.empty_like(values)
    for begin in range(0, values.size, ROWS_AT_A_TIME):  # all at once would take 200 bytes a row
        part = slice(begin, min(begin + ROWS_AT_A_TIME, values.size))
        around = np.stack([padded[part.start + k : part.stop + k] for k in range(7) if k != 3])
        middle[part] = np.median(around, axis=0)
        order = np.argsort(np.abs(around - middle[part]), axis=0)[:4]
        spread[part] = np.ptp(np.take_along_axis(around, order, axis=0), axis=0)
    return middle, spread


def late_stamps_um(readings_um: Array, residual: Array, noise_um: float) -> Array:
    """Return how large the residual of each row is, one deviation, by late stamps, from the way since the row before.

    The way to the next row does not count: the command that begins it may come after this one is read.

    Args:
        readings_um: (n,) that the hypothesis gives.
        residual: (n,) of these rows, µm.
        noise_um: of every row, moving or not.
    """
    way = np.abs(np.diff(readings_um, prepend=readings_um[:1]))
    moving = way > FAR * noise_um
    if np.count_nonzero(moving) < FEWEST_ROWS:
        return np.zeros_like(way)
    share = deviation(residual[moving] / way[moving])
    by_noise = noise_um * float(np.median(1.0 / way[moving]))
    return max(share**2 - by_noise**2, 0.0) ** 0.5 * way


def outlying(readings: Readings, residual: Array, noise_um: float, *, without_late: bool = False) -> Mask:
    """Return the rows whose residual stands alone: far from neighbours that agree among themselves.

    Args:
        readings: of a record.
        residual: of all its rows, µm.
        noise_um: of a reading.
        without_late: rows are left out that are off by no more than late stamps explain.
    """
    rows = np.nonzero(readings.usable)[0]
    found = np.zeros(residual.size, dtype=bool)
    if rows.size < FEWEST_ROWS:
        return found
    # coarse readings: what lies beyond a step is nought for most of them, and one step more is no wonder
    noise_um = max(noise_um, 2.0 * readings.half_step_um / FAR)
    middle, spread = neighbourhood_um(residual, rows)
    apart = np.abs(residual[rows] - middle)
    late_um = np.zeros(residual.size)
    if without_late:
        late_um[rows] = late_stamps_um(readings.measured_um[rows] - residual[rows], residual[rows], noise_um)
    bulk = deviation(residual[rows] - middle)
    alone = apart > FAR * np.hypot(max(noise_um, bulk), late_um[rows])
    alone &= apart > 2.0 * spread
    found[rows[alone]] = True
    late_rows = _late_rows(readings, residual, noise_um)
    found[rows] &= apart > _most_after_jumps_um(readings, rows, apart, found[rows], late_rows)
    return found | _among_jumps(readings, residual, np.hypot(noise_um, late_um), late_rows)


def _most_after_jumps_um(
    readings: Readings, rows: NDArray[np.int64], apart_um: Array, alone: Mask, late_rows: int
) -> Array:
    """Return for every usable row how far the residual may ring after the jumps of the command before it, 0 elsewhere.

    That is twice as far as the readings that do not stand alone go for as many volts, the most that a mode overshoots,
    and as far as chance may lead where it stands apart after half of the jumps.
    """
    heights = [x[readings.places][rows] for x in heights_after_jumps_V(readings.course_V, late_rows)]
    jumps, near = max(np.count_nonzero(x) for x in heights), np.sum(heights, axis=0)
    if jumps == 0:
        return near
    others = readings.measured_um[rows][~alone]
    span_V = float(np.ptp(readings.course_V))
    by_stroke = float(np.ptp(others)) / span_V if others.size and span_V > 0.0 else 0.0
    after = np.sort(apart_um[near > 0.0] / near[near > 0.0])[::-1]
    return near * max(OVERSHOOT * by_stroke, FAR * float(after[min((jumps + 1) // 2, after.size - 1)]))


def _late_rows(readings: Readings, residual: Array, noise_um: float) -> int:
    """Return how many rows after a jump of the command the hypothesis begins to move, as a rule."""
    known = np.isfinite(readings.measured_um) & np.isfinite(residual)
    simulated = np.full(readings.course_V.size, np.nan)
    simulated[readings.places] = np.where(known, readings.measured_um - residual, np.nan)
    changes = np.flatnonzero(np.diff(readings.course_V)) + 1
    if changes.size == 0:
        return 0
    ends = np.append(changes[1:], simulated.size)[: changes.size]
    jumps = next(heights_after_jumps_V(readings.course_V)) > 0.0
    found = []
    for before, begin, end in zip(np.append(0, changes[:-1]), changes, ends, strict=True):
        # where the command rests before and after
        if not jumps[begin] or min(begin - before, end - begin) <= AFTER_A_JUMP_ROWS:
            continue
        moved = np.abs(simulated[begin:end] - simulated[begin - 1]) > FAR * noise_um
        found += [int(np.argmax(moved))] if moved.any() else []
    return int(np.median(found)) if len(found) >= FEWEST_ROWS else 0


def _among_jumps(readings: Readings, residual: Array, scatter_um: Array, late_rows: int) -> Mask:
    """Return the rows after jumps that are an exception among them.

    In units of what is usual so many rows after a jump of that height; where these have long tails, of the tails.
    """
    sizes = np.zeros(residual.size)
    near = np.zeros(residual.size, dtype=bool)
    for of_all in heights_after_jumps_V(readings.course_V, late_rows):
        heights = of_all[readings.places]
        rows = np.nonzero((heights > 0.0) & readings.usable & ~near)[0]
        near[rows] = True
        if rows.size >= FEWEST_ROWS:
            usual_um = float(np.median(scatter_um[rows]))
            ringing = max(deviation(residual[rows]) ** 2 - usual_um**2, 0.0) ** 0.5 / np.median(heights[rows])
            usual = np.hypot(scatter_um[rows], ringing * heights[rows])
            sizes[rows] = np.abs(residual[rows]) / np.maximum(usual, TINY)
    if not near.any():
        return near
    tails = float(np.quantile(sizes[near], 1.0 - EXCEPTIONS)) / NORMAL_TAIL
    return sizes > FAR * max(tails, 1.0)
