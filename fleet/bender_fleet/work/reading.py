"""How the files of records are read, the same for all units."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bender_loop.records.drive import InputHold
from bender_loop.records.record import Record, read_record
from bender_loop.tables.table import PLAIN
from bender_loop.tables.text_layout import TextLayout


@dataclass(frozen=True, slots=True)
class Reading:
    """Names, units and layout of the columns, and what stands between two rows.

    Attributes:
        columns: other names, as in `read_record`.
        units: of these columns.
        layout: of text files.
        hold: how the voltage runs from row to row.
        untimed: the times are only an order.
    """

    columns: str | None = None
    units: str | None = None
    layout: TextLayout = PLAIN
    hold: InputHold = "hold"
    untimed: bool = False

    def records(self, paths: Sequence[Path]) -> list[Record]:
        """Return the records of a unit.

        Raises:
            InputError: a file cannot be read.
        """
        return [read_record(path, self.columns, self.units, self.layout) for path in paths]

    def to_dict(self) -> dict[str, Any]:
        """Return what a key is made of."""
        return {
            "columns": self.columns,
            "units": self.units,
            "layout": repr(self.layout),
            "hold": self.hold,
            "untimed": self.untimed,
        }
