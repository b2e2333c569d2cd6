"""What a picture of any number of rows needs: extremes by stretches of equal length, in memory that does not grow."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST = 1200
COLUMNS = ("time_s", "lowest", "highest", "top")


@dataclass(slots=True)
class Lane:
    """Extremes of the whitened residual, and the largest statistic over its threshold.

    Attributes:
        table: (n, 4) of `COLUMNS`; the last stretch may not be full.
        size: rows of a stretch.
        filled: rows of the last stretch.
    """

    table: Array = field(default_factory=lambda: np.zeros((0, 4)))
    size: int = 8
    filled: int = 0

    def add(self, time_s: Array, innovations: Array, tops: Array) -> None:
        """Add rows (n,)."""
        rows = np.column_stack([time_s, innovations, innovations, tops])
        begin = 0
        if 0 < self.filled < self.size and len(rows):
            begin = min(self.size - self.filled, len(rows))
            self.table[-1] = _extremes(np.concatenate([self.table[-1:], rows[:begin]]), begin + 1)[0]
            self.filled += begin
        for part in _parts(rows[begin:], self.size):
            self.table = np.concatenate([self.table, part])
        if begin < len(rows):
            self.filled = (len(rows) - begin - 1) % self.size + 1
        while len(self.table) > MOST:
            self._put_together()

    def _put_together(self) -> None:
        if len(self.table) % 2 == 0:
            self.filled += self.size
        self.table, self.size = np.concatenate(_parts(self.table, 2)), 2 * self.size


def _parts(rows: Array, size: int) -> list[Array]:
    """Return the extremes of every full stretch of so many rows, and of those that are left."""
    full = len(rows) // size * size
    parts = [_extremes(rows[:full], size)] if full else []
    return [*parts, _extremes(rows[full:], len(rows) - full)] if full < len(rows) else parts


def _extremes(rows: Array, size: int) -> Array:
    parts = rows.reshape(-1, size, 4)
    lowest = np.min(np.where(np.isnan(parts[:, :, 1]), np.inf, parts[:, :, 1]), axis=1)
    highest = np.max(np.where(np.isnan(parts[:, :, 2]), -np.inf, parts[:, :, 2]), axis=1)
    return np.column_stack(
        [
            parts[:, 0, 0],
            np.where(np.isfinite(lowest), lowest, np.nan),
            np.where(np.isfinite(highest), highest, np.nan),
            np.max(parts[:, :, 3], axis=1),
        ]
    )
