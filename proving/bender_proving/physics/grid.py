"""Sub-steps between everything that happens: commands that act, readings, corners of the supply."""

from dataclasses import dataclass

import numpy as np
from bender_proving.physics.lobatto import Array, C
from numpy.typing import NDArray

_SAME_TIME_S = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Sub-steps in the order of time; no two of them overlap and nothing happens inside one.

    Attributes:
        start_s: beginning of each sub-step, shape (n,).
        step_s: its length, shape (n,).
        reading: for each row the sub-step at whose end it is read; -1 where nothing has happened yet.
    """

    start_s: Array
    step_s: Array
    reading: NDArray[np.intp]

    @property
    def nodes_s(self) -> Array:
        """Times of the collocation nodes, shape (n, 5)."""
        return self.start_s[:, None] + self.step_s[:, None] * C

    @property
    def middle_s(self) -> Array:
        """A time inside each sub-step, shape (n,)."""
        return self.start_s + 0.5 * self.step_s

    def at_rows(self, signal: Array) -> Array:
        """What `signal`, shape (n, 5), is when the rows are read: before what happens at that instant; 0 at rest."""
        return np.where(self.reading >= 0, signal[self.reading, -1], 0.0)


def build_grid(reading_s: Array, happenings_s: Array, start_s: float, longest_s: float) -> Grid:
    """Divide the time from `start_s` to the last reading into sub-steps of at most `longest_s`.

    Args:
        reading_s: when rows are read, ascending; those not after `start_s` find the bench at rest.
        happenings_s: every other instant that must be a border of sub-steps, in any order.
        start_s: when the first command acts.
        longest_s: upper bound of a sub-step.
    """
    end_s = max(float(reading_s[-1]), start_s + longest_s)
    borders = np.concatenate([[start_s, end_s], reading_s, happenings_s])
    borders = np.unique(borders[(borders >= start_s) & (borders <= end_s)])
    borders = borders[np.concatenate([[True], np.diff(borders) > _SAME_TIME_S])]
    gaps = np.diff(borders)
    counts = np.maximum(1, np.ceil(gaps / longest_s - 1e-9)).astype(np.intp)
    first = np.cumsum(counts) - counts
    inside = np.arange(counts.sum()) - np.repeat(first, counts)
    steps = np.repeat(gaps / counts, counts)
    starts = np.repeat(borders[:-1], counts) + inside * steps
    nearest = np.searchsorted(borders, reading_s - _SAME_TIME_S)
    ends_at = np.concatenate([[0], np.cumsum(counts)])[np.minimum(nearest, len(counts))]
    return Grid(start_s=starts, step_s=steps, reading=np.where(reading_s > start_s + _SAME_TIME_S, ends_at - 1, -1))
