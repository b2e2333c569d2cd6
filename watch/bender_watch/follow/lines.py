"""Rows from the bytes of a table that may still grow, in any layout that records are read in."""

import csv
import io
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bender_loop.errors import InputError
from bender_loop.shell.run import remark_held
from bender_loop.tables.text_layout import COMMENT_MARKS, TextLayout, decoded, number
from bender_watch.follow.heading import KEYS, Heading, Naming, heading_of
from bender_watch.follow.rows import Rows

Array = NDArray[np.float64]

LONGEST_LINE = 1 << 20
"""Bytes; what is longer is no row."""
ROWS_BACK = 16
"""So many rows whose times increase but begin before the last one: the clock was set back, or a record began."""


class Part(NamedTuple):
    """Rows, and whether they are the first ones of another record."""

    begins: bool
    rows: Rows


class NoRecordError(InputError):
    """A text that holds no record from its first line on."""


@dataclass(slots=True)
class Lines:
    """Lines of one file, whole ones taken as they come.

    Attributes:
        path: for messages.
        naming: of the columns.
        strict: a bad row is an error; else it is a lost reading, or left out where it has no time of its own.
        bad: rows that were left out or had no reading because of what stood there.
        offset: bytes that were taken, up to the end of the last whole line.
        line: number of that line.
        heading: what the top says; None where it is not known yet.
    """

    path: str
    naming: Naming
    strict: bool
    bad: int = 0
    offset: int = 0
    line: int = 0
    heading: Heading | None = None
    last_s: float = -math.inf
    last_V: float = 0.0
    encoding: str = ""
    _top: bytes = b""
    _rest: bytes = b""
    _back: list[list[float]] = field(default_factory=list)

    @property
    def waiting(self) -> int:
        """Bytes behind `offset` that are no whole line yet."""
        return len(self._rest)

    def take(self, data: bytes, *, is_all: bool = False) -> list[Part]:
        """Return the rows of the lines that have become whole.

        Args:
            data: that was read further.
            is_all: no more will come, so that the last line is a whole one.

        Raises:
            NoRecordError: it is no table, or a column is missing.
            InputError: a row is bad and `strict`.
        """
        whole = self._whole(data, is_all)
        if self.heading is None:
            whole = self._below_the_top(whole, is_all)
        if not whole or self.heading is None:
            return []
        text = whole.decode(self.encoding, errors="replace")
        values = self._quick(text)
        found = [(False, values)] if values is not None else self._slow(text)
        self.line += text.count("\n")
        return [Part(begins, self._rows(x)) for begins, x in found if len(x)]

    def state(self) -> dict[str, Any]:
        """Return what is remembered behind the rows that were given, as JSON can hold it."""
        assert self.heading is not None
        return {
            "offset": self.offset, "line": self.line, "bad": self.bad, "last_s": self.last_s, "last_V": self.last_V,
            "back": [list(x) for x in self._back], "encoding": self.encoding, "heading": self.heading.to_dict(),
        }  # fmt: skip

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        self.offset, self.line, self.bad = (int(state[x]) for x in ("offset", "line", "bad"))
        self.last_s, self.last_V = float(state["last_s"]), float(state["last_V"])
        self._back, self.encoding = [list(x) for x in state["back"]], str(state["encoding"])
        self.heading = Heading.of(state["heading"])

    def _whole(self, data: bytes, is_all: bool) -> bytes:
        """Return the complete lines, and keep the beginning of one that is still being written."""
        data = self._rest + data
        if is_all:
            whole, self._rest = data + (b"" if data.endswith(b"\n") or not data else b"\n"), b""
            self.offset += len(data)
            return whole
        end = data.rfind(b"\n") + 1
        whole, self._rest = data[:end], data[end:]
        self.offset += end
        if len(self._rest) > LONGEST_LINE:
            self._refuse(self.line + whole.count(b"\n") + 1, None, f"more than {LONGEST_LINE} bytes", "a row")
            # what comes up to its end is no row either
            self.offset, self._rest = self.offset + len(self._rest) - 1, b"?"
        return whole

    def _below_the_top(self, data: bytes, is_all: bool) -> bytes:
        """Return the rows below the top once that is known; nothing where more is needed."""
        self._top += data
        if not self._top and not is_all:
            return b""
        if 0 in self._top:
            raise NoRecordError(
                f"{self.path}: found a zero byte, as UTF-16 and binary files have, expected text in UTF-8"
            )
        try:
            text, self.encoding = decoded(Path(self.path), self._top, TextLayout())
            self.heading = heading_of(self.path, text or "\n", self.naming, is_all=is_all)
        except InputError as error:
            raise NoRecordError(str(error)) from None
        if self.heading is None:
            return b""
        for sentence in self.naming.passed_over(self.heading):
            remark_held(sentence)
        lines = self._top.splitlines(keepends=True)
        self.line, self._top = self.heading.first - 1, b""
        return b"".join(lines[self.line :])

    def _rows(self, values: Array) -> Rows:
        acting = values[:, 3] if values.shape[1] > len(KEYS) - 1 else None
        return Rows(values[:, 0], values[:, 1], values[:, 2], acting)

    @property
    def _columns(self) -> list[tuple[str, int, tuple[float, float]]]:
        """Keys, places and scales of the columns that are there."""
        known = self.heading
        assert known is not None
        return [x for x in zip(KEYS, known.places, known.scales, strict=True) if x[1] >= 0]

    def _quick(self, text: str) -> Array | None:
        """Return the values (n, 3 or 4) where every cell is a number and times increase, None otherwise."""
        known = self.heading
        assert known is not None
        if self._back or (known.decimal == "," and "." in text):
            return None
        plain = text.replace(",", ".") if known.decimal == "," else text
        if known.delimiter != " " and not _is_even(plain, known.delimiter, len(known.names)):
            return None
        delimiter = None if known.delimiter == " " else known.delimiter
        places = [place for _, place, _ in self._columns]
        try:
            values = np.loadtxt(io.StringIO(plain), delimiter=delimiter, usecols=places, ndmin=2, comments=None)
        except (ValueError, IndexError):
            return None
        if not len(values):
            return None
        for k, (_, _, (multiplier, divisor)) in enumerate(self._columns):
            values[:, k] = values[:, k] * multiplier / divisor
        times = values[:, 0]
        sound = np.all(np.isfinite(values[:, [0, 1]])) and not np.any(np.isinf(values))
        if not sound or times[0] <= self.last_s or np.any(np.diff(times) <= 0.0):
            return None
        if values.shape[1] > len(KEYS) - 1 and not _acts_within(values):
            return None
        self.last_s, self.last_V = float(times[-1]), float(values[-1, 1])
        return values

    def _slow(self, text: str) -> list[tuple[bool, Array]]:
        """Return the values of the rows that are some, in parts of which all but the first begin another record."""
        parts: list[tuple[bool, list[list[float]]]] = [(False, [])]
        for at, row in enumerate(text.split("\n")[:-1], self.line + 1):
            before = self.bad
            values = self._values(row.removesuffix("\r"), at)
            self.bad = min(self.bad, before + 1)
            if values is None:
                continue
            if values[0] > self.last_s:
                self._back.clear()
                self._add(parts, values)
            elif self._is_back(values, at):
                parts.append((True, []))
                for one in self._back:
                    self._add(parts, one)
                self._back.clear()
        return [(begins, np.array(x).reshape(-1, len(self._columns))) for begins, x in parts]

    def _add(self, parts: list[tuple[bool, list[list[float]]]], values: list[float]) -> None:
        parts[-1][1].append(values)
        self.last_s, self.last_V = values[0], values[1]

    def _is_back(self, values: list[float], line: int) -> bool:
        """Keep a row whose time is not behind the last one; return whether so many of them are another record."""
        self._refuse(line, "time", f"{values[0]:g}", f"more than {self.last_s:g} of the row before")
        if self._back and values[0] <= self._back[-1][0]:
            self._back.clear()
        self._back.append(values)
        if len(self._back) < ROWS_BACK:
            return False
        self.bad -= ROWS_BACK
        self.last_s = -math.inf
        return True

    def _values(self, row: str, line: int) -> list[float] | None:
        """Return the values of a row; None where it has no time or not the cells of the others."""
        known = self.heading
        assert known is not None
        if not row.strip() or (known.told and row.lstrip().startswith(COMMENT_MARKS)):
            return None
        if '"' in row:
            cells = next(csv.reader([row], delimiter=known.delimiter, skipinitialspace=True), [])
        else:
            cells = row.split(None if known.delimiter == " " else known.delimiter)
        while len(cells) > len(known.names) and not cells[-1].strip():
            cells.pop()
        if len(cells) != len(known.names):
            return self._refuse(line, None, f"{len(cells)} cells", f"{len(known.names)} as in the header")
        values = [self._cell(cells, *column, line) for column in self._columns]
        if not math.isfinite(values[0]):
            return self._refuse(line, "time", f"{values[0]}", "a finite number")
        if not math.isfinite(values[1]):
            self._refuse(line, "voltage", f"{values[1]}", "a finite number")
            values[1] = self.last_V
        if math.isinf(values[2]):
            self._refuse(line, "displacement", f"{values[2]}", "a finite number, or none")
            values[2] = math.nan
        if len(values) > len(KEYS) - 1 and not (math.isfinite(values[3]) and values[3] >= values[0]):
            self._refuse(line, "command_time", f"{values[3]:g}", f"at least {values[0]:g}, the time of the row")
            values[3] = values[0]
        return values

    def _cell(self, cells: list[str], key: str, place: int, scale: tuple[float, float], line: int) -> float:
        cell = cells[place].strip()
        if not cell and key == "displacement":
            return math.nan
        assert self.heading is not None
        try:
            return number(cell, self.heading.decimal) * scale[0] / scale[1]
        except ValueError:
            self._refuse(line, key, repr(cell[:40]), "a number")
            return math.nan

    def _refuse(self, line: int, key: str | None, found: str, expected: str) -> None:
        if self.strict:
            column = "" if key is None else f", column {self._name(key)}"
            raise InputError(f"{self.path}, line {line}{column}: found {found}, expected {expected}")
        self.bad += 1

    def _name(self, key: str) -> str:
        assert self.heading is not None
        return self.heading.names[self.heading.places[KEYS.index(key)]]


def _acts_within(values: Array) -> bool:
    acting, times = values[:, 3], values[:, 0]
    return bool(np.all(np.isfinite(acting)) and np.all(acting >= times) and np.all(acting[:-1] <= times[1:]))


def _is_even(text: str, delimiter: str, width: int) -> bool:
    """Return whether every line has so many cells."""
    marks = np.frombuffer(text.encode("utf-8", "replace"), dtype=np.uint8)
    ends = np.flatnonzero(marks == ord("\n"))
    if not len(ends) or ord(delimiter) > 127:
        return False
    begins = np.concatenate([[0], ends[:-1] + 1])
    return bool(np.all(np.add.reduceat((marks == ord(delimiter)).astype(np.int32), begins) == width - 1))
