"""Files, folders, runs and standard input, followed as they grow or read once, a part at a time."""

import math
import sys
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bender_loop.errors import InputError
from bender_watch.follow.growing import BYTES_AT_ONCE, Growing
from bender_watch.follow.heading import Naming
from bender_watch.follow.lines import Lines, NoRecordError
from bender_watch.follow.rows import Rows
from bender_watch.follow.run import RunRows, is_run

WAIT_S = 0.2
TEXT = (".csv", ".txt", ".tsv")

Position = dict[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class Arrival:
    """What came.

    Attributes:
        record: name of the record.
        begins: it is the first of its record.
        rows: None where nothing came, and the source waits.
        position: where to go on from, behind these rows; empty where nobody can.
        refused: why the record is passed over; "" where it is not.
    """

    record: str
    begins: bool
    rows: Rows | None
    position: Position
    refused: str = ""


@dataclass(slots=True)
class Source:
    """Where rows come from.

    Attributes:
        paths: records, folders, a run, or none for standard input.
        naming: of the columns.
        follow: wait for more where there is none; else read once and end.
        position: where an earlier watch has got to; empty for the beginning.
        wait: sleeps for so many seconds.
        bad: rows so far that were left out or had no reading because of what stood there.
    """

    paths: Sequence[Path]
    naming: Naming
    follow: bool
    position: Position = field(default_factory=dict)
    wait: Callable[[float], None] = time.sleep
    bad: int = 0

    @property
    def run(self) -> Path | None:
        """The folder of the run on the bench that is followed; None where it is none."""
        return self.paths[0] if len(self.paths) == 1 and is_run(self.paths[0]) else None

    def arrivals(self) -> Iterator[Arrival]:
        """Yield what comes; ends where all was read, or a run is over.

        Raises:
            InputError: a file cannot be read, or holds what no record does.
        """
        if not self.paths:
            yield from self._standard_input()
        elif self.run is not None:
            yield from self._run(self.run)
        else:
            yield from self._files()

    def _standard_input(self) -> Iterator[Arrival]:
        lines = Lines("standard input", self.naming, strict=False)
        repeated = _Repeated.of(self.position)
        begins, first = not repeated.first, repeated.first
        while True:
            data = sys.stdin.buffer.read1(BYTES_AT_ONCE)  # pyright: ignore[reportAttributeAccessIssue]
            parts = lines.take(data, is_all=not data)
            for k, part in enumerate(parts, 1):
                again, rows = repeated.new(part.rows)
                begins = begins or again or part.begins
                if rows is None:
                    continue
                first = row_of(rows, 0) if begins or not first else first
                self.bad = lines.bad
                position = {"first": first, "time_s": float(rows.time_s[-1])} if k == len(parts) else {}
                yield Arrival("standard input", begins, rows, position)
                begins = False
            if not data:
                return

    def _run(self, path: Path) -> Iterator[Arrival]:
        run = RunRows(path)
        skipped_s = float(self.position.get("time_s", "-inf"))
        begins = "time_s" not in self.position
        while True:
            rows = run.further()
            if rows is not None and (rows := _after(rows, skipped_s)) is not None:
                yield Arrival(str(path), begins, rows, {"time_s": float(rows.time_s[-1])})
                begins = False
                continue
            if run.ended or not self.follow:
                return
            yield Arrival(str(path), False, None, {})
            self.wait(WAIT_S)

    def _files(self) -> Iterator[Arrival]:
        """What is passed over is not said before there is a record: where there is none, nothing is to be written."""
        held: list[Arrival] = []
        for arrival in self._one_by_one():
            held.append(arrival)
            if not arrival.refused or self.follow:
                yield from held
                held.clear()
        yield from held

    def _one_by_one(self) -> Iterator[Arrival]:
        done = list(self.position.get("done", ()))
        now = self.position.get("file")
        passed_over: list[Path] = []
        while True:
            waiting = [x for x in self._listed() if str(x) not in done]
            if not waiting:
                if not self.follow:
                    if len(passed_over) == len(done):
                        many = f"{len(passed_over)} files that are none" if done else "no file"
                        raise InputError(f"{', '.join(map(str, self.paths))}: found {many}, expected records")
                    return
                yield Arrival("", False, None, {})
                self.wait(WAIT_S)
                if self.run is not None:
                    # its journals came behind its folder
                    yield from self._run(self.run)
                    return
                continue
            path = next((x for x in waiting if str(x) == now), waiting[0])
            try:
                yield from self._file(path, done, now == str(path))
            except InputError as error:
                # a note that somebody puts into a folder is no reason to end
                if path in self.paths or not (self.follow or isinstance(error, NoRecordError)):
                    raise
                passed_over.append(path)
                yield Arrival(str(path), False, None, {}, str(error))
            done.append(str(path))
            now = None

    def _listed(self) -> list[Path]:
        found: list[Path] = []
        for path in self.paths:
            if path.is_dir():
                found += sorted(x for x in path.iterdir() if x.suffix.lower() in TEXT and x.is_file())
            elif path.exists() or self.follow:
                found.append(path)
            else:
                raise InputError(f"{path}: no such file, expected a record, a folder of records or a run")
        return found

    def _file(self, path: Path, done: list[str], resumed: bool) -> Iterator[Arrival]:
        position = self.position if resumed else {}
        while True:
            file = Growing(path)
            lines = Lines(str(path), self.naming, not self.follow, self.bad)
            begins = True
            if position:
                lines.restore(position["lines"])
                file.restore(lines.offset, tuple(position["top"]))
                position, begins = {}, False
            try:
                is_other = yield from self._followed(file, lines, begins, done)
            finally:
                file.close()
            if not is_other:
                return

    def _followed(self, file: Growing, lines: Lines, begins: bool, done: list[str]) -> Generator[Arrival, None, bool]:
        """Yield what comes of one file; return whether another one has taken its place."""
        while True:
            data = file.read()
            is_over = data is None or (not data and (not self.follow or self._newer(file.path, done)))
            if not data and not is_over:
                yield Arrival(str(file.path), False, None, {})
                self.wait(WAIT_S)
                continue
            parts = lines.take(data or b"", is_all=is_over)
            for k, part in enumerate(parts, 1):
                self.bad = lines.bad
                here = {"done": list(done), "file": str(file.path), "lines": lines.state(), "top": file.state()}
                yield Arrival(str(file.path), begins or part.begins, part.rows, here if k == len(parts) else {})
                begins = False
            if is_over:
                return data is None

    def _newer(self, path: Path, done: list[str]) -> bool:
        """Return whether there is a record behind this one."""
        return any(str(x) not in (*done, str(path)) and x.is_file() for x in self._listed())


@dataclass(slots=True)
class _Repeated:
    """Rows that a stream gives once more after the watch has been begun again: those of the record that was watched.

    Attributes:
        first: the first row of that record; empty where there was none.
        until_s: time up to which it was watched.
    """

    first: tuple[float, ...]
    until_s: float
    _is_known: bool = False

    @classmethod
    def of(cls, position: Position) -> "_Repeated":
        """Return what a position says."""
        return cls(tuple(position.get("first", ())), float(position.get("time_s", "-inf")))

    def new(self, rows: Rows) -> tuple[bool, Rows | None]:
        """Return whether rows begin another record, and those of them that were not watched; None for none.

        A stream gives the record once more, goes on behind its last row, or brings another record.
        """
        if not self.first:
            return False, rows
        if not self._is_known:
            self._is_known = True
            if row_of(rows, 0) != self.first and rows.time_s[0] <= self.until_s:
                self.first = ()
                return True, rows
        return False, _after(rows, self.until_s)


def row_of(rows: Rows, place: int) -> tuple[float, ...]:
    """Return a row as plain numbers; what is lost as -1."""
    reading = float(rows.displacement_um[place])
    return float(rows.time_s[place]), float(rows.voltage_V[place]), -1.0 if math.isnan(reading) else reading


def _after(rows: Rows, time_s: float) -> Rows | None:
    keep = int((rows.time_s <= time_s).sum())
    return rows if keep == 0 else rows.part(slice(keep, None)) if keep < len(rows) else None
