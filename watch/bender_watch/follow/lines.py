"""Rows from the lines of a table that may still grow: one header line, commas, points as decimal signs."""

import io
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bender_loop.errors import InputError
from bender_loop.records.record import COLUMNS
from bender_loop.tables import units as unit_tables
from bender_watch.follow.rows import Rows

Array = NDArray[np.float64]

KEYS = ("time", "voltage", "displacement", "command_time")


@dataclass(frozen=True, slots=True)
class Naming:
    """How the columns are called and in which units they come.

    Attributes:
        names: by key of `KEYS`.
        scales: (multiplier, divisor) by key.
    """

    names: dict[str, str]
    scales: dict[str, tuple[float, float]]

    @classmethod
    def of(cls, columns: str | None, units: str | None) -> "Naming":
        """Return the naming that options say: "time=t,voltage=U,displacement=d" or "t,U,d", and "ms,V,mm".

        Raises:
            InputError: a key or a unit is not known.
        """
        names = {key: COLUMNS[key].field for key in KEYS}
        given: dict[str, str] = {}
        words = columns.split(",") if columns else []
        if words and not any("=" in x for x in words):
            words = [f"{key}={name}" for key, name in zip(KEYS, words, strict=False)]
        for word in words:
            key, _, name = word.partition("=")
            if key.strip() not in KEYS or not name:
                raise InputError(f"--columns: found {word!r}, expected KEY=NAME with a key of {', '.join(KEYS)}")
            given[key.strip()] = name.strip()
        scales = {}
        keys = list(given) or ["time", "voltage", "displacement"]
        for key, unit in zip(keys, (units or "").split(",") if units else [], strict=False):
            scale = unit_tables.find(COLUMNS[key].scales, unit)
            if scale is None:
                raise InputError(
                    f"--units: found {unit!r} for {key}, expected {unit_tables.near(unit, COLUMNS[key].scales)}"
                )
            scales[key] = scale
        return cls(names | given, scales)


@dataclass(slots=True)
class Lines:
    """Lines of one file, whole ones taken as they come.

    Attributes:
        path: for messages.
        naming: of the columns.
        strict: a bad row is an error; else it is a lost reading, or left out where it has no time of its own.
        bad: rows that were left out or had no reading because of what stood there.
    """

    path: str
    naming: Naming
    strict: bool
    bad: int = 0
    header: tuple[str, ...] = ()
    line: int = 0
    last_s: float = -math.inf
    last_V: float = 0.0
    _places: list[int | None] = field(default_factory=list)

    def take(self, text: str) -> Rows | None:
        """Return the rows of whole lines; None for none.

        Raises:
            InputError: a column is missing, or a row is bad and `strict`.
        """
        if not self.header:
            first, _, text = text.partition("\n")
            self._begin(first)
        if not text.strip():
            self.line += text.count("\n")
            return None
        values = self._quick(text)
        if values is None:
            values = self._slow(text)
        self.line += text.count("\n")
        if not len(values):
            return None
        self.last_s, self.last_V = float(values[-1, 0]), float(values[-1, 1])
        acting = None if self._places[3] is None else values[:, 3]
        return Rows(values[:, 0], values[:, 1], values[:, 2], acting)

    def _begin(self, first: str) -> None:
        self.header = tuple(x.strip() for x in first.lstrip("\ufeff").rstrip("\r").split(","))
        self.line = 1
        places: list[int | None] = []
        for key in KEYS:
            name = self.naming.names[key]
            if name in self.header:
                places.append(self.header.index(name))
            elif key == "command_time":
                places.append(None)
            else:
                near = unit_tables.near(name, self.header)
                raise InputError(f"{self.path}, line 1, column {name}: no such column; {near}; --columns {key}=NAME")
        self._places = places

    def _quick(self, text: str) -> Array | None:
        """Return the values (n, 3 or 4) where every cell is a number and times increase, None otherwise."""
        places = [x for x in self._places if x is not None]
        try:
            values = np.loadtxt(io.StringIO(text), delimiter=",", usecols=places, ndmin=2, comments=None)
        except (ValueError, IndexError):
            return None
        values = self._scaled(values)
        times = values[:, 0]
        sound = np.all(np.isfinite(values[:, [0, 1]])) and not np.any(np.isinf(values))
        if not sound or times[0] <= self.last_s or np.any(np.diff(times) <= 0.0):
            return None
        return values if values.shape[1] == 3 or self._acts_within(values) else None

    @staticmethod
    def _acts_within(values: Array) -> bool:
        acting, times = values[:, 3], values[:, 0]
        return bool(np.all(np.isfinite(acting)) and np.all(acting >= times) and np.all(acting[:-1] <= times[1:]))

    def _scaled(self, values: Array) -> Array:
        keys = [key for key, place in zip(KEYS, self._places, strict=True) if place is not None]
        for k, key in enumerate(keys):
            multiplier, divisor = self.naming.scales.get(key, (1.0, 1.0))
            values[:, k] = values[:, k] * multiplier / divisor
        return values

    def _slow(self, text: str) -> Array:
        keys = [key for key, place in zip(KEYS, self._places, strict=True) if place is not None]
        found: list[list[float]] = []
        last_s, last_V = self.last_s, self.last_V
        for number, row in enumerate(text.splitlines(), self.line + 1):
            if not row.strip():
                continue
            cells = row.split(",")
            values = [self._cell(cells, key, number) for key in keys]
            time_s = values[0]
            if not (math.isfinite(time_s) and time_s > last_s):
                self._refuse(number, "time", f"{time_s:g}", f"more than {last_s:g} of the row before")
                continue
            if not math.isfinite(values[1]):
                self._refuse(number, "voltage", f"{values[1]}", "a finite number")
                values[1] = last_V
            if math.isinf(values[2]):
                values[2] = math.nan
            if len(values) == 4 and not (math.isfinite(values[3]) and values[3] >= time_s):
                self._refuse(number, "command_time", f"{values[3]:g}", f"at least {time_s:g}, the time of the row")
                values[3] = time_s
            found.append(values)
            last_s, last_V = time_s, values[1]
        return np.array(found).reshape(-1, len(keys))

    def _cell(self, cells: list[str], key: str, line: int) -> float:
        place = self._places[KEYS.index(key)]
        assert place is not None
        cell = cells[place].strip() if place < len(cells) else None
        if cell is None:
            self._refuse(line, key, f"{len(cells)} cells", f"{len(self.header)}")
            return math.nan
        if not cell and key == "displacement":
            return math.nan
        try:
            multiplier, divisor = self.naming.scales.get(key, (1.0, 1.0))
            return float(cell) * multiplier / divisor
        except ValueError:
            self._refuse(line, key, repr(cell), "a number")
            return math.nan

    def _refuse(self, line: int, key: str, found: str, expected: str) -> None:
        if self.strict:
            name = self.naming.names[key]
            raise InputError(f"{self.path}, line {line}, column {name}: found {found}, expected {expected}")
        self.bad += 1
