"""The last rows, as many as are kept: what an alarm looks back on."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KEPT = 20_000
COLUMNS = ("row", "time_s", "voltage_V", "command_time_s", "displacement_um", "expected_um", "innovation", "judged")


@dataclass(slots=True)
class History:
    """Rows in columns, the whitened signatures behind the others.

    Attributes:
        signatures: how many there are.
    """

    signatures: int
    _room: Array = field(init=False)
    _end: int = field(default=0, init=False)
    _kept: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        # rows are moved once in as many as there is room for, and not whenever some come
        self._room = np.empty((2 * KEPT, len(COLUMNS) + self.signatures))

    def __len__(self) -> int:
        return self._kept

    @property
    def table(self) -> Array:
        """The rows (n, columns), the last one last."""
        return self._room[self._end - self._kept : self._end]

    def add(self, columns: dict[str, Array], whitened: Array) -> None:
        """Add rows, no more than `KEPT`; the oldest ones beyond that are let go."""
        begin, end = self._make_room(len(whitened))
        for place, name in enumerate(COLUMNS):
            self._room[begin:end, place] = columns[name]
        self._room[begin:end, len(COLUMNS) :] = whitened

    def _make_room(self, rows: int) -> tuple[int, int]:
        """Return where further rows begin and end."""
        if self._end + rows > len(self._room):
            kept = self.table
            self._room[: self._kept] = kept
            self._end = self._kept
        self._end += rows
        self._kept = min(self._kept + rows, KEPT)
        return self._end - rows, self._end

    def clear(self) -> None:
        """Let go of all rows."""
        self._end = self._kept = 0

    def restore(self, table: Array) -> None:
        """Go on from rows that were kept."""
        self.clear()
        begin, end = self._make_room(len(table))
        self._room[begin:end] = table

    def column(self, name: str) -> Array:
        """Return a column (n,)."""
        return self.table[:, COLUMNS.index(name)]

    def whitened(self) -> Array:
        """Return the whitened signatures (n, j)."""
        return self.table[:, len(COLUMNS) :]
