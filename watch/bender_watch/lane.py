"""What a picture of any number of rows needs: extremes by stretches of equal length, in memory that does not grow."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST = 1200
COLUMNS = ("time_s", "lowest", "highest", "top")


@dataclass(slots=True)
class Lane:
    """Extremes of the whitened residual, and the largest statistic over its threshold.

    Attributes:
        table: (n, 4) of `COLUMNS`.
        size: rows of a stretch.
    """

    table: Array = field(default_factory=lambda: np.zeros((0, 4)))
    size: int = 8
    _waiting: Array = field(default_factory=lambda: np.zeros((0, 4)))

    def add(self, time_s: Array, innovations: Array, tops: Array) -> None:
        """Add rows (n,)."""
        rows = np.column_stack([time_s, innovations, innovations, tops])
        self._waiting = np.concatenate([self._waiting, rows])
        whole = len(self._waiting) // self.size
        if whole:
            self.table = np.concatenate([self.table, _extremes(self._waiting[: whole * self.size], self.size)])
            self._waiting = self._waiting[whole * self.size :]
        while len(self.table) > MOST:
            even = len(self.table) // 2 * 2
            self.table = np.concatenate([_extremes(self.table[:even], 2), self.table[even:]])
            self.size *= 2

    def rows(self) -> Array:
        """Return the stretches, the last one as it stands."""
        last = _extremes(self._waiting, len(self._waiting)) if len(self._waiting) else self._waiting
        return np.concatenate([self.table, last])

    def state(self) -> dict[str, Any]:
        """Return what is remembered."""
        return {"table": self.table, "size": self.size, "waiting": self._waiting}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        self.table, self.size, self._waiting = state["table"], int(state["size"]), state["waiting"]


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
