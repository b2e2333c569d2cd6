"""How the files of records are read, the same for all units."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
        linear: the command runs straight from row to row instead of being held.
        untimed: the times are only an order.
    """

    columns: str | None = None
    units: str | None = None
    layout: TextLayout = PLAIN
    linear: bool = False
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
            "linear": self.linear,
            "untimed": self.untimed,
        }
