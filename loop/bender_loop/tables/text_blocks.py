"""The rows of a table in a text file, kept as text and read a column and a block of lines at a time.

Five million rows as a list of cells are gigabytes; as text they are as large as their file. A block in which every line
has the same number of cells and nothing is quoted goes through the compiled reader of NumPy; a block that it refuses is
read cell by cell, which finds the fault and names its line.
"""

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BLOCK_CHARACTERS = 1 << 22
Progress = Callable[[int, int, str], None]
"""Told how many blocks of how many are done, and of which column."""


class CellError(ValueError):
    """A cell that is no number: in which row (from 0), and what it holds."""

    def __init__(self, row: int, cell: str) -> None:
        super().__init__(f"row {row}: {cell!r}")
        self.row, self.cell = row, cell


@dataclass(frozen=True, slots=True, eq=False)
class TextBlocks:
    """Rows of cells as blocks of text; see `text_blocks`.

    Attributes:
        blocks: whole lines each, ended by a line feed.
        rows: number of lines of each block.
        delimiter: between cells.
        number: makes a number of a cell, ValueError where it is none.
        decimal: the decimal sign.
        progress: is told how far the reading is.
    """

    blocks: tuple[str, ...]
    rows: tuple[int, ...]
    delimiter: str
    number: Callable[[str, str], float]
    decimal: str
    progress: Progress | None = None

    def __len__(self) -> int:
        return sum(self.rows)

    def column(self, index: int, name: str, gaps: bool) -> NDArray[np.float64]:
        """Return a column (n,) as numbers; with `gaps` an empty cell is NaN.

        Raises:
            CellError: a cell is no number.
        """
        found, at = np.empty(len(self)), 0
        for k, (block, rows) in enumerate(zip(self.blocks, self.rows, strict=True)):
            if self.progress is not None:
                self.progress(k, len(self.blocks), name)
            quick = self._quick(block, index)
            found[at : at + rows] = self._cell_by_cell(block, index, gaps, at) if quick is None else quick
            at += rows
        return found

    def _quick(self, block: str, index: int) -> NDArray[np.float64] | None:
        if self.decimal == ",":
            if "." in block:  # of thousands
                return None
            block = block.replace(",", ".")
        try:
            return np.loadtxt(
                io.StringIO(block), delimiter=self.delimiter, usecols=index, comments=None, ndmin=1, dtype=np.float64
            )
        except ValueError:
            return None

    def _cell_by_cell(self, block: str, index: int, gaps: bool, first: int) -> list[float]:
        found = []
        for row, line in enumerate(block.removesuffix("\n").split("\n"), first):
            cell = line.split(self.delimiter)[index]
            try:
                found.append(np.nan if gaps and not cell.strip() else self.number(cell, self.decimal))
            except ValueError:
                raise CellError(row, cell) from None
        return found


def text_blocks(
    body: str,
    width: int,
    delimiter: str,
    number: Callable[[str, str], float],
    decimal: str = ".",
    progress: Progress | None = None,
) -> TextBlocks | None:
    """Return the rows of a text, None where they are not all plain: another number of cells, quotes, empty lines.

    Args:
        body: the lines below the header.
        width: number of cells of a line.
        delimiter: one character between them.
        number: makes a number of a cell and a decimal sign, ValueError where it is none.
        decimal: the decimal sign.
        progress: is told how far the reading is.
    """
    body = body.replace("\r\n", "\n") if "\r" in body else body
    body = body.rstrip("\n")
    if not body or '"' in body or "\r" in body or delimiter == decimal or ord(delimiter) > 127:
        return None
    blocks, rows, at = [], [], 0
    while at < len(body):
        cut = body.find("\n", at + BLOCK_CHARACTERS)
        end = len(body) if cut < 0 else cut
        block = body[at:end] + "\n"
        count = _lines_of(block, width, delimiter)
        if count is None:
            return None
        blocks.append(block)
        rows.append(count)
        at = end + 1
    return TextBlocks(tuple(blocks), tuple(rows), delimiter, number, decimal, progress)


def _lines_of(block: str, width: int, delimiter: str) -> int | None:
    """Return the number of lines of a block, None where one has another number of cells."""
    marks = np.frombuffer(block.encode("utf-8", "surrogatepass"), dtype=np.uint8)
    ends = np.flatnonzero(marks == ord("\n"))
    begins: Sequence[int] | NDArray[np.intp] = np.concatenate([[0], ends[:-1] + 1])
    cells = np.add.reduceat((marks == ord(delimiter)).astype(np.int32), begins)
    # a line without cells, or of blanks, is left to the reader that knows what to say of it
    return len(ends) if np.all(cells == width - 1) and (width > 1 or np.all(np.diff(ends, prepend=-1) > 1)) else None
