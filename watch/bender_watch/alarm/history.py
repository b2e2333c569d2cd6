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
        table: (n, columns) rows, the last one last.
    """

    signatures: int
    table: Array = field(init=False)

    def __post_init__(self) -> None:
        self.table = np.zeros((0, len(COLUMNS) + self.signatures))

    def __len__(self) -> int:
        return len(self.table)

    def add(self, columns: dict[str, Array], whitened: Array) -> None:
        """Add rows; the oldest ones beyond `KEPT` are let go."""
        rows = np.column_stack([*(columns[name] for name in COLUMNS), whitened])
        self.table = np.concatenate([self.table, rows])[-KEPT:]

    def clear(self) -> None:
        """Let go of all rows."""
        self.table = self.table[:0]

    def column(self, name: str) -> Array:
        """Return a column (n,)."""
        return self.table[:, COLUMNS.index(name)]

    def whitened(self) -> Array:
        """Return the whitened signatures (n, j)."""
        return self.table[:, len(COLUMNS) :]
