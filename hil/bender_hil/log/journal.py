"""Append-only lines of JSON, each written to the file in one unbuffered write.

What was written is in the hands of the operating system at once: a `kill -9` loses nothing, at some 20 us a line.
Each process of a run has a journal of its own, so that no two ever write into one file.
"""

import json
import math
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bender_loop.errors import InputError

Entry = dict[str, Any]


class Journal:
    """A journal that is being written.

    Args:
        path: made anew; a journal of an earlier run is never added to.

    Raises:
        InputError: the file is there already or cannot be made.
    """

    def __init__(self, path: Path) -> None:
        flags = os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0)
        try:
            self._file = os.open(path, flags, 0o644)
        except FileExistsError:
            raise InputError(f"{path}: there is a run already; choose another directory with --out") from None
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror}); choose another directory") from error
        self._count = 0

    def write(self, kind: str, **facts: Any) -> None:
        """Add an entry: its number, `time.perf_counter`, its kind and the facts; NaN and infinity become null."""
        entry = {"n": self._count, "t": time.perf_counter(), "kind": kind, **facts}
        try:
            line = json.dumps(entry, allow_nan=False)
        except ValueError:
            line = json.dumps(finite(entry), allow_nan=False)
        self._count += 1
        os.write(self._file, line.encode() + b"\n")

    def sync(self) -> None:
        """Wait until the disk has it too."""
        os.fsync(self._file)

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)


class GuardJournal(Journal):
    """The guard's: a disk that is full ends the run, but never keeps the output from coming down.

    Attributes:
        failure: why something could not be written, None while all is well.
    """

    failure: str | None = None

    def write(self, kind: str, **facts: Any) -> None:
        """As `Journal.write`; a failure is kept instead of raised."""
        try:
            super().write(kind, **facts)
        except OSError as error:
            self.failure = self.failure or error.strerror or str(error)

    def sync(self) -> None:
        """As `Journal.sync`; a failure is kept instead of raised."""
        try:
            super().sync()
        except OSError as error:
            self.failure = self.failure or error.strerror or str(error)


def read_journal(path: Path) -> Iterator[Entry]:
    """The entries of a journal; a last line that a crash cut short is left out.

    Raises:
        InputError: there is no such file, a line is no entry, or an entry is missing.
    """
    try:
        lines = path.read_bytes().split(b"\n")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); expected the directory of a run") from error
    for number, line in enumerate(lines[:-1]):
        try:
            entry = json.loads(line)
            found = entry["n"]
        except (ValueError, TypeError, KeyError):
            raise InputError(f"{path}, line {number + 1}: found {line[:60]!r}, expected an entry") from None
        if found != number:
            raise InputError(f"{path}, line {number + 1}: found entry {found}, expected {number}; lines are missing")
        yield entry


def finite(value: Any) -> Any:
    """The same with None for every number that is NaN or infinite, which JSON does not know."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return value
