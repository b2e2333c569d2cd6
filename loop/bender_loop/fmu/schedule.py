"""Further inputs of an FMU over the time of a record."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from fmpy.model_description import ModelDescription

from bender_loop.errors import InputError
from bender_loop.fmu.ports import Port, Setting, find_further_input
from bender_loop.records.further import Array, Further

WITHIN = 1e-3
"""Of the shortest time between two rows: a step that begins so much before a row begins with it."""


@dataclass(frozen=True, slots=True)
class Schedule:
    """Further inputs, held from row to row.

    Attributes:
        ports: the inputs.
        begins_s: from when the values of each row hold.
        values: of every row, one for each input, in the FMU's own units.
    """

    ports: tuple[Port, ...]
    begins_s: tuple[float, ...]
    values: tuple[tuple[float, ...], ...]

    @classmethod
    def of(
        cls, path: Path, description: ModelDescription, taken: Sequence[str], time_s: Array, further: Sequence[Further]
    ) -> "Schedule":
        """Return the schedule of a record.

        Args:
            path: of the FMU, for messages.
            description: of the FMU.
            taken: names of inputs that are driven otherwise.
            time_s: (n,) of the rows.
            further: the inputs over these rows.

        Raises:
            InputError: there is no such input, it is taken, or its unit is of another quantity.
        """
        for name in {x.name for x in further} & set(taken):
            raise InputError(f"--further-input: found {name!r}, which takes the command, expected another input")
        ports = tuple(find_further_input(path, description, x.name, x.unit) for x in further)
        rows = np.column_stack([x.values / port.internal for x, port in zip(further, ports, strict=True)])
        begins = time_s - WITHIN * float(np.min(np.diff(time_s)))
        return cls(ports, tuple(begins.tolist()), tuple(map(tuple, rows.tolist())))

    def at(self, time_s: float) -> tuple[float, ...]:
        """Return the values that hold at a time; before the first row those of the first row."""
        return self.values[max(bisect_right(self.begins_s, time_s) - 1, 0)] if self.ports else ()

    def settings(self, time_s: float) -> list[Setting]:
        """Return what the inputs are set to at a time."""
        return [Setting(x.type, x.reference, v) for x, v in zip(self.ports, self.at(time_s), strict=True)]


NO_SCHEDULE = Schedule((), (), ())
