"""A stretch of rows of a record: what is known of a device from one moment to the next."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Columns (n,), as a record has them.

    Attributes:
        time_s: of the readings, increasing.
        voltage_V: commands.
        displacement_um: readings, NaN where one is lost.
        command_time_s: from when the commands act; None for `time_s`.
    """

    time_s: Array
    voltage_V: Array
    displacement_um: Array
    command_time_s: Array | None = None

    def __len__(self) -> int:
        return self.time_s.size

    def part(self, where: slice) -> "Rows":
        """Return some of the rows."""
        acting = None if self.command_time_s is None else self.command_time_s[where]
        return Rows(self.time_s[where], self.voltage_V[where], self.displacement_um[where], acting)

    @classmethod
    def of(cls, record: Record) -> "Rows":
        """Return the rows of a record."""
        return cls(record.time_s, record.voltage_V, record.displacement_um, record.command_time_s)

    def record(self) -> Record:
        """Return the rows as a record."""
        return Record(self.time_s, self.voltage_V, self.displacement_um, command_time_s=self.command_time_s)
