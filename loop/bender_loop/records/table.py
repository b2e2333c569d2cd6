"""CSV tables whose faults are told by file, line and column."""

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bender_loop.errors import InputError
from bender_loop.records.units import near


@dataclass(frozen=True, slots=True)
class Table:
    """The cells of a CSV file.

    Attributes:
        path: where it came from, for messages.
        header: column names, stripped.
        rows: cells of the data rows, each as long as the header.
        lines: line number in the file of each data row, counted from 1.
    """

    path: Path
    header: tuple[str, ...]
    rows: tuple[list[str], ...]
    lines: tuple[int, ...]

    def __contains__(self, name: str) -> bool:
        return name in self.header

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def heading(self) -> str:
        """Where the column names stand, for messages."""
        return f"{self.path}, line 1"

    def numbers(self, name: str, *, gaps: bool = False) -> NDArray[np.float64]:
        """The column `name` as numbers; with `gaps` an empty cell is NaN.

        Raises:
            InputError: no such column, two of that name, or a cell that is not a number.
        """
        index = self._index(name)
        values = np.empty(len(self.rows))
        for row, cells in enumerate(self.rows):
            try:
                values[row] = _number(cells[index], gaps)
            except ValueError:
                raise self.fault(row, name, repr(cells[index]), "a number") from None
        return values

    def fault(self, row: int, name: str, found: str, expected: str) -> InputError:
        """The error for data row `row` (from 0) of column `name`."""
        return InputError(f"{self.path}, line {self.lines[row]}, column {name}: found {found}, expected {expected}")

    def _index(self, name: str) -> int:
        count = self.header.count(name)
        if count != 1:
            found = "no such column" if count == 0 else f"{count} columns of that name"
            raise InputError(f"{self.path}, line 1, column {name}: {found}; {near(name, self.header)}")
        return self.header.index(name)


class ColumnTable:
    """Named columns that come from a program instead of a file; told of and read like a `Table`.

    Attributes:
        path: what stands for the file in messages.
        header: column names.

    Raises:
        InputError: columns differ in length or are no rows of values.
    """

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
                raise self.fault(row, name, repr(value), "a number") from None
        return found

    def fault(self, row: int, name: str, found: str, expected: str) -> InputError:
        """Return the error for row `row` (from 0) of column `name`."""
        return InputError(f"{self.path}, row {row}, column {name}: found {found}, expected {expected}")


def _number(cell: str, gaps: bool) -> float:
    cell = cell.strip()
    if gaps and not cell:
        return math.nan
    if "_" in cell:
        raise ValueError
    return float(cell)


def read_table(path: Path) -> Table:
    """Read a CSV file: one header line, comma, UTF-8 with or without a byte order mark, any line end.

    Empty lines at the end are left out.

    Raises:
        InputError: the file is missing, is not such a table, or has a row of another length than the header.
    """
    path = Path(path)
    text = _text(path)
    first = text.lstrip().partition("\n")[0]
    if ";" in first and "," not in first:
        raise InputError(f"{path}, line 1: columns are separated by semicolons, expected commas")
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


def _text(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: byte {error.start} is not UTF-8 text, expected a CSV file in UTF-8") from error


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
