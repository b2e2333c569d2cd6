"""What the top of a table says of the rows below it: where the columns stand, in which units, how cells are divided."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bender_loop.errors import InputError
from bender_loop.records.columns import COLUMNS
from bender_loop.records.record import Origin, checked_options, origins_in
from bender_loop.tables.column_choice import with_heading
from bender_loop.tables.quantities import Quantities, factor
from bender_loop.tables.table import Table
from bender_loop.tables.text_layout import SAMPLE_LINES, TextLayout, cells_of
from bender_loop.tables.units import Scale, near

KEYS = ("time", "voltage", "displacement", "command_time")
ENOUGH_LINES = 12
"""From which the layout of a table is found that is not in the form of a record."""


@dataclass(frozen=True, slots=True)
class Naming:
    """How columns are called and in which units they come, where options say so.

    Attributes:
        columns: as "time=t,voltage=U,displacement=d" or "t,U,d"; None for what the table says.
        units: of them, as "ms,V,mm".
        kept: units in which rows are kept: those of the training record; None for what the table says.
        unread: names that columns may have, and what is told of one that is there and that nothing reads.
    """

    columns: str | None = None
    units: str | None = None
    kept: Quantities | None = None
    unread: tuple[tuple[str, str], ...] = ()

    def is_met_by(self, header: Sequence[str]) -> bool:
        """Return whether a header has all columns that options name."""
        named = [x.rpartition("=")[2].strip() for x in (self.columns or "").split(",")]
        return self.columns is not None and all(x in header for x in named)

    def passed_over(self, heading: "Heading") -> list[str]:
        """Return what is told of columns that nothing reads."""
        read = {heading.names[x] for x in heading.places if x >= 0}
        own = {name: with_heading(name, heading.names) for name, _ in self.unread}
        return [told for name, told in self.unread if own[name] in heading.names and own[name] not in read]

    def checked(self) -> "Naming":
        """Return itself.

        Raises:
            InputError: a key or a unit is not known.
        """
        checked_options(self.columns, self.units)
        return self


@dataclass(frozen=True, slots=True)
class Heading:
    """The layout of a table.

    Attributes:
        names: of its columns.
        places: of the columns of `KEYS`, -1 for one that is not there.
        scales: (multiplier, divisor) of each.
        delimiter: between cells.
        decimal: the decimal sign.
        first: number of the first line of rows, from 1.
        told: how the table is read, where that is not as records are; "" otherwise.
    """

    names: tuple[str, ...]
    places: tuple[int, ...]
    scales: tuple[Scale, ...]
    delimiter: str = ","
    decimal: str = "."
    first: int = 2
    told: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return what `of` takes."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}

    @classmethod
    def of(cls, known: dict[str, Any]) -> "Heading":
        """Return the heading that was kept."""
        values: dict[str, Any] = known | {name: tuple(known[name]) for name in ("names", "places")}
        values["scales"] = tuple((float(a), float(b)) for a, b in known["scales"])
        return cls(**values)


def heading_of(path: str, text: str, naming: Naming, *, is_all: bool) -> Heading | None:
    """Return what the lines at the top of a table say, None where more of them are needed.

    Args:
        path: for messages.
        text: whole lines.
        naming: what options say.
        is_all: no more lines will come.

    Raises:
        InputError: it is no table, or a column is missing.
    """
    lines = text.splitlines()
    header = tuple(x.strip() for x in lines[0].split(","))
    if not text.strip() or any(x.field in header for x in COLUMNS.values()) or naming.is_met_by(header):
        return _placed(Table(Path(path), header, (), ()), naming, ",", ".", 2, "")
    if len(lines) < ENOUGH_LINES and not is_all:
        return None
    try:
        cells = cells_of(Path(path), text, "utf-8", TextLayout())
    except InputError:
        if len(lines) < SAMPLE_LINES and not is_all:
            return None
        raise
    table = Table(Path(path), cells.header, (), (), units=cells.units, names_line=cells.names_line)
    first = cells.lines[0] if cells.lines else len(lines) + 1
    return _placed(table, naming, cells.delimiter, cells.decimal, first, cells.told)


def _placed(table: Table, naming: Naming, delimiter: str, decimal: str, first: int, told: str) -> Heading:
    origins = origins_in(table, naming.columns, naming.units)
    found = [origins.get(key) for key in KEYS]
    for origin in found:
        if origin is not None and table.header.count(origin.name) != 1:
            count = table.header.count(origin.name)
            many = f"{count} columns of that name" if count else "no such column"
            raise InputError(f"{table.heading}, column {origin.name}: {many}; {near(origin.name, table.header)}")
    places = tuple(-1 if x is None else table.header.index(x.name) for x in found)
    scales = tuple(_scale(table, key, x, naming.kept) for key, x in zip(KEYS, found, strict=True))
    return Heading(table.header, places, scales, delimiter, decimal, first, told)


def _scale(table: Table, key: str, origin: Origin | None, kept: Quantities | None) -> Scale:
    """Return the scale from a column to the unit in which rows are kept.

    Raises:
        InputError: they are of different quantities.
    """
    scale = (1.0, 1.0) if origin is None else origin.scale
    if isinstance(scale, tuple) or kept is None or origin is None:
        return scale if isinstance(scale, tuple) else (1.0, 1.0)
    try:
        return factor(scale, kept.command if key == "voltage" else kept.reading), 1.0
    except InputError as error:
        raise InputError(f"{table.heading}, column {origin.name}: {error}, as the training record has it") from None
