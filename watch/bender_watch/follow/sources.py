"""Files, folders, runs and standard input, followed as they grow or read once, a part at a time."""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bender_loop.errors import InputError
from bender_watch.follow.lines import Lines, Naming
from bender_watch.follow.rows import Rows
from bender_watch.follow.run import RunRows, is_run

BYTES_AT_ONCE = 1 << 20
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
        position: where to go on from, behind these rows.
    """

    record: str
    begins: bool
    rows: Rows | None
    position: Position


@dataclass(slots=True)
class Source:
    """Where rows come from.

    Attributes:
        paths: records, folders, a run, or none for standard input.
        naming: of the columns.
        follow: wait for more where there is none; else read once and end.
        position: where an earlier watch has got to; empty for the beginning.
        wait: sleeps for so many seconds.
        lines: of the record that is read, for what was bad in it.
    """

    paths: Sequence[Path]
    naming: Naming
    follow: bool
    position: Position = field(default_factory=dict)
    wait: Callable[[float], None] = time.sleep
    lines: Lines | None = None
    bad: int = 0

    def arrivals(self) -> Iterator[Arrival]:
        """Yield what comes; ends where all was read, or a run is over.

        Raises:
            InputError: a file cannot be read, or holds what no record does.
        """
        if not self.paths:
            yield from self._standard_input()
        elif len(self.paths) == 1 and is_run(self.paths[0]):
            yield from self._run(self.paths[0])
        else:
            yield from self._files()

    def _standard_input(self) -> Iterator[Arrival]:
        lines = self.lines = Lines("standard input", self.naming, strict=False)
        skipped_s = float(self.position.get("time_s", "-inf"))
        begins, rest = "time_s" not in self.position, b""
        while True:
            data = sys.stdin.buffer.read1(BYTES_AT_ONCE)  # pyright: ignore[reportAttributeAccessIssue]
            whole, rest = _whole(rest + data, last=not data)
            rows = lines.take(whole) if whole else None
            self.bad = lines.bad
            if rows is not None:
                rows = _after(rows, skipped_s)
            if rows is not None:
                yield Arrival("standard input", begins, rows, {"time_s": float(rows.time_s[-1])})
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
        done = list(self.position.get("done", ()))
        now = self.position.get("file")
        while True:
            waiting = [x for x in self._listed() if str(x) not in done]
            if not waiting:
                if not self.follow:
                    return
                yield Arrival("", False, None, {})
                self.wait(WAIT_S)
                continue
            path = next((x for x in waiting if str(x) == now), waiting[0])
            yield from self._file(path, done, now == str(path))
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
        lines = self.lines = Lines(str(path), self.naming, strict=not self.follow)
        offset, begins, rest = 0, True, b""
        if resumed:
            offset, begins = int(self.position["offset"]), False
            lines.take(str(self.position["header"]) + "\n")
            lines.line, lines.last_s = int(self.position["line"]), float(self.position["last_s"])
        while True:
            data = _read(path, offset + len(rest), self.follow)
            if not data:
                newer = self._newer(path, done)
                if not self.follow or newer:
                    rows = lines.take(rest.decode(errors="replace") + "\n") if rest else None
                    if rows is not None:
                        offset += len(rest)
                        yield self._arrival(path, begins, rows, offset, done, lines)
                    return
                yield Arrival(str(path), False, None, {})
                self.wait(WAIT_S)
                continue
            whole, rest_now = _whole(rest + data, last=False)
            offset += len(rest) + len(data) - len(rest_now)
            rest = rest_now
            rows = lines.take(whole) if whole else None
            if rows is not None:
                yield self._arrival(path, begins, rows, offset, done, lines)
                begins = False

    def _newer(self, path: Path, done: list[str]) -> bool:
        """Return whether there is a record behind this one."""
        return any(str(x) not in (*done, str(path)) and x.is_file() for x in self._listed())

    def _arrival(self, path: Path, begins: bool, rows: Rows, offset: int, done: list[str], lines: Lines) -> Arrival:
        self.bad = lines.bad
        position = {
            "done": list(done), "file": str(path), "offset": offset, "header": ",".join(lines.header),
            "line": lines.line, "last_s": lines.last_s,
        }  # fmt: skip
        return Arrival(str(path), begins, rows, position)


def _whole(data: bytes, *, last: bool) -> tuple[str, bytes]:
    """Return whole lines as text, and what is left of the one that is still being written."""
    if last:
        return data.decode(errors="replace") + ("" if data.endswith(b"\n") or not data else "\n"), b""
    end = data.rfind(b"\n") + 1
    return data[:end].decode(errors="replace"), data[end:]


def _read(path: Path, offset: int, follow: bool) -> bytes:
    try:
        with path.open("rb") as file:
            file.seek(offset)
            return file.read(BYTES_AT_ONCE)
    except FileNotFoundError:
        if follow:
            return b""
        raise InputError(f"{path}: no such file, expected a record") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error


def _after(rows: Rows, time_s: float) -> Rows | None:
    keep = int((rows.time_s <= time_s).sum())
    return rows if keep == 0 else rows.part(slice(keep, None)) if keep < len(rows) else None
