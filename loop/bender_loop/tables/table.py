"""Tables whose faults are told by file, line and column: CSV as records have it, or in any other layout."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bender_loop.errors import InputError
from bender_loop.shell.bounded import MOST_RECORD_BYTES, read_bounded
from bender_loop.tables.containers import columns_of
from bender_loop.tables.text_blocks import CellError, Progress, TextBlocks, text_blocks
from bender_loop.tables.text_layout import Cells, TextLayout, cells_of, decoded, number, outline
from bender_loop.tables.units import near

_NUMBER = {False: "a number", True: "a number; leave the cell empty where the reading is missing"}


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """The columns of a file.

    Attributes:
        path: where it came from, for messages.
        header: column names, stripped.
        rows: cells of the data rows, each as long as the header; none for a binary file.
        lines: line number in the file of each data row, counted from 1; the row's number for a binary file.
        decimal: the decimal sign of the cells.
        units: what the file says of the unit of each column, "" where it says nothing.
        told: how the file was read, where that is not as records are; "" otherwise.
        values: columns of a binary file.
        blocks: the rows of a text file as text, in place of `rows`.
        names_line: line number of the header, None where the file has none.
        column_hint: how a column of another name is given.
    """

    path: Path
    header: tuple[str, ...]
    rows: tuple[list[str], ...]
    lines: Sequence[int]
    decimal: str = "."
    units: tuple[str, ...] = ()
    told: str = ""
    values: Mapping[str, NDArray[np.float64]] | None = None
    blocks: TextBlocks | None = None
    names_line: int | None = 1
    column_hint: ClassVar[str] = "--columns {}=NAME; if the names stand further down: --skip-rows N"

    def __len__(self) -> int:
        return len(self.lines)

    def __contains__(self, name: str) -> bool:
        return name in self.header

    @property
    def heading(self) -> str:
        """Where the column names stand, for messages."""
        return f"{self.path}, line {self.names_line}" if self.names_line else f"{self.path}"

    def numbers(self, name: str, *, gaps: bool = False) -> NDArray[np.float64]:
        """The column `name` as numbers; with `gaps` an empty cell is NaN.

        Raises:
            InputError: no such column, two of that name, or a cell that is not a number.
        """
        index = self._index(name)
        if self.values is not None:
            return self.values[name]
        if self.blocks is not None:
            try:
                return self.blocks.column(index, name, gaps)
            except CellError as error:
                raise self.fault(error.row, name, repr(error.cell), _NUMBER[gaps]) from None
        values = np.empty(len(self.rows))
        for row, cells in enumerate(self.rows):
            try:
                values[row] = _number(cells[index], gaps, self.decimal)
            except ValueError:
                raise self.fault(row, name, repr(cells[index]), _NUMBER[gaps]) from None
        return values

    def fault(self, row: int, name: str, found: str, expected: str) -> InputError:
        """The error for data row `row` (from 0) of column `name`."""
        return InputError(f"{self.path}, line {self.lines[row]}, column {name}: found {found}, expected {expected}")

    def _index(self, name: str) -> int:
        count = self.header.count(name)
        if count != 1:
            found = "no such column" if count == 0 else f"{count} columns of that name"
            raise InputError(f"{self.heading}, column {name}: {found}; {near(name, self.header)}")
        return self.header.index(name)


class ColumnTable:
    """Named columns that come from a program instead of a file; told of and read like a `Table`.

    Attributes:
        path: what stands for the file in messages.
        header: column names.
        units: none is said.
        told: nothing.

    Raises:
        InputError: columns differ in length or are no rows of values.
    """

    units: tuple[str, ...] = ()
    told = ""
    column_hint = 'columns="{}=NAME"'

    def __init__(self, name: str, columns: Mapping[str, ArrayLike]) -> None:
        self.path = self.heading = name
        self.header = tuple(str(key) for key in columns)
        self._columns = {str(key): np.asarray(values) for key, values in columns.items()}
        shapes = {key: values.shape for key, values in self._columns.items()}
        if len(set(shapes.values())) > 1 or any(len(shape) != 1 for shape in shapes.values()):
            raise InputError(f"{name}: found columns of the shapes {shapes}, expected one length for all")

    def __contains__(self, name: str) -> bool:
        return name in self._columns

    def __len__(self) -> int:
        return len(next(iter(self._columns.values()), ()))

    def numbers(self, name: str, *, gaps: bool = False) -> NDArray[np.float64]:
        """Return the column `name` as numbers; with `gaps` None is NaN.

        Raises:
            InputError: no such column, or a value that is not a number.
        """
        if name not in self._columns:
            raise InputError(f"{self.path}, column {name}: no such column; {near(name, self.header)}")
        values = self._columns[name]
        if values.dtype.kind in "fiu":
            return values.astype(np.float64)
        found = np.empty(values.size)
        for row, value in enumerate(values.tolist()):
            try:
                found[row] = math.nan if gaps and value is None else float(value)
            except (TypeError, ValueError):
                expected = "a number; None where it is missing" if gaps else "a number"
                raise self.fault(row, name, repr(value), expected) from None
        return found

    def fault(self, row: int, name: str, found: str, expected: str) -> InputError:
        """Return the error for row `row` (from 0) of column `name`."""
        return InputError(f"{self.path}, row {row}, column {name}: found {found}, expected {expected}")


def _number(cell: str, gaps: bool, decimal: str) -> float:
    if gaps and not cell.strip():
        return math.nan
    return number(cell, decimal)


PLAIN = TextLayout()


def read_table(path: Path) -> Table:
    """Read a CSV file: one header line, comma, UTF-8 with or without a byte order mark, any line end.

    Raises:
        InputError: the file is missing, is not such a table, or has a row of another length than the header.
    """
    path = Path(path)
    try:
        return _plain_table(path, _bytes(path).decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: byte {error.start} is not UTF-8 text, expected a CSV file in UTF-8") from error


def read_any_table(
    path: Path, layout: TextLayout = PLAIN, names: Sequence[str] = (), progress: Progress | None = None
) -> Table:
    """Read a table as records have it, or in a layout that is given or found.

    Args:
        path: the file; `.parquet`, `.mat`, `.h5`, `.npz` and `.tdms` are read by their libraries.
        layout: how a text file is read; what is not given is found.
        names: columns that are looked for; a header with one of these in its first line is read as records are.
        progress: is told how far the reading is.

    Raises:
        InputError: the file is missing, is not such a table, or has a row of another length than the header.
    """
    path = Path(path)
    columns = columns_of(path)
    if columns is not None:
        return _of_columns(path, columns)
    text, encoding = decoded(path, _bytes(path), layout)
    if layout.is_found and encoding == "utf-8" and _is_plain(text, names):
        return _plain_table(path, text, progress)
    seen = outline(path, text, encoding, layout)
    if seen is not None:
        body, cells = seen
        blocks = text_blocks(body, len(cells.header), cells.delimiter, number, cells.decimal, progress)
        if blocks is not None:
            lines = range(cells.lines[0], cells.lines[0] + len(blocks))
            return replace(_of_cells(path, cells, lines), rows=(), blocks=blocks)
    cells = cells_of(path, text, encoding, layout)
    return _of_cells(path, cells, cells.lines)


def _of_cells(path: Path, cells: Cells, lines: Sequence[int]) -> Table:
    return Table(
        path, cells.header, cells.rows, lines, cells.decimal, cells.units, cells.told, names_line=cells.names_line
    )


def _of_columns(path: Path, columns: Mapping[str, NDArray[np.float64]]) -> Table:
    """Return the columns of the commonest length."""
    lengths = [x.size for x in columns.values()]
    length = max(set(lengths), key=lambda n: (lengths.count(n), n))
    kept = {name: x for name, x in columns.items() if x.size == length}
    return Table(
        path,
        tuple(kept),
        (),
        tuple(range(1, length + 1)),
        values=kept,
        told=f"columns {', '.join(kept)}",
        names_line=None,
    )


def _is_plain(text: str, names: Sequence[str]) -> bool:
    """Return whether the first line is a header as records have it: with commas and with one of the names."""
    if not text.strip():
        return True
    header = [x.strip().strip('"') for x in text.splitlines()[0].split(",")]
    return any(name in header for name in names)


def _plain_table(path: Path, text: str, progress: Progress | None = None) -> Table:
    """Read a CSV file: one header line, comma, any line end. Empty lines at the end are left out."""
    head, _, body = text.partition("\n")
    if '"' not in head and "\r" not in head.removesuffix("\r"):
        header = tuple(name.strip() for name in head.removesuffix("\r").split(","))
        blocks = text_blocks(body, len(header), ",", number, progress=progress)
        if blocks is not None:
            return Table(path, header, (), range(2, len(blocks) + 2), blocks=blocks)
    records = _records(path, text)
    if not records:
        raise InputError(f"{path}: the file is empty, expected a header line and rows of numbers")
    header = tuple(name.strip() for name in records[0][1])
    rows, lines = [], []
    for line, cells in records[1:]:
        while len(cells) > len(header) and not cells[-1].strip():
            cells.pop()
        if len(cells) != len(header):
            raise InputError(
                f"{path}, line {line}: found {len(cells)} cells, expected {len(header)} as in the header "
                "(comma between columns, point as the decimal sign)"
            )
        rows.append(cells)
        lines.append(line)
    return Table(path, header, tuple(rows), tuple(lines))


def _bytes(path: Path) -> bytes:
    return read_bounded(path, MOST_RECORD_BYTES, "a table (CSV)")


def _records(path: Path, text: str) -> list[tuple[int, list[str]]]:
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    records: list[tuple[int, list[str]]] = []
    try:
        for cells in reader:
            records.append((reader.line_num, cells))
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}: not a CSV row ({error})") from error
    while records and not any(cell.strip() for cell in records[-1][1]):
        records.pop()
    return records
