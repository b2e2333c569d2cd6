"""Append-only lines of JSON, each written to the file in one unbuffered write.

What was written is in the hands of the operating system at once: a `kill -9` loses nothing, at some 20 us a line.
Each process of a run has a journal of its own, so that no two ever write into one file.
"""

import contextlib
import errno
import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bender_loop.errors import InputError
from bender_loop.shell.files import finite, read_text_file

LARGEST_BYTES = 1 << 30
"""Of a journal that is read: some 20 hours at 30 frames per second."""

Entry = dict[str, Any]


class JournalError(OSError):
    """A line could not be written; `strerror` says why."""


class Journal:
    """A journal that is being written.

    Every line is whole or not there: what a full disk cuts short is taken back. The first line that can be written
    again says how many are missing before it.

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
            raise InputError(f"{path}: already holds a run; choose another directory with --out") from None
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"{path}: cannot be written ({reason}); choose another directory") from error
        self._name = path.name
        self._count = self._missing = self._size = 0

    def write(self, kind: str, **facts: Any) -> None:
        """Add an entry: its number, `time.perf_counter`, its kind and the facts; NaN and infinity become null.

        Raises:
            JournalError: the disk is full, or somebody has removed the file.
        """
        entry = {"n": self._count, "t": time.perf_counter(), "kind": kind, **facts}
        if self._missing:
            entry["missing_before"] = self._missing
        try:
            line = json.dumps(entry, allow_nan=False)
        except ValueError:
            line = json.dumps(finite(entry), allow_nan=False)
        try:
            self._append(line.encode() + b"\n")
        except OSError as error:
            self._missing += 1
            raise JournalError(error.errno, error.strerror or str(error), self._name) from error
        self._count += 1
        self._missing = 0

    def sync(self) -> None:
        """Wait until the disk has it too; JournalError when it cannot."""
        try:
            os.fsync(self._file)
        except OSError as error:
            raise JournalError(error.errno, error.strerror or str(error), self._name) from error

    def close(self) -> None:
        """Close the file."""
        with contextlib.suppress(OSError):
            os.close(self._file)

    def _append(self, line: bytes) -> None:
        if os.fstat(self._file).st_nlink == 0:
            raise OSError(errno.ENOENT, "it was removed")
        done = 0
        try:
            while done < len(line):
                done += os.write(self._file, line[done:])
        except OSError:
            if done:
                os.ftruncate(self._file, self._size)
            raise
        self._size += len(line)


class GuardJournal(Journal):
    """The guard's: a disk that is full ends the run, but never keeps the output from coming down.

    Attributes:
        failure: why something could not be written, None while all is well.
    """

    failure: str | None = None

    def write(self, kind: str, **facts: Any) -> None:
        """As `Journal.write`; a failure, whatever it is, is kept instead of raised."""
        try:
            super().write(kind, **facts)
        except Exception as error:
            self._keep(error)

    def sync(self) -> None:
        """As `Journal.sync`; a failure is kept instead of raised."""
        try:
            super().sync()
        except OSError as error:
            self._keep(error)

    def _keep(self, error: Exception) -> None:
        self.failure = self.failure or getattr(error, "strerror", None) or str(error) or type(error).__name__


def read_journal(path: Path) -> Iterator[Entry]:
    """The entries of a journal; a last line that a crash cut short is left out.

    Raises:
        InputError: there is no such file, a line is no entry, or an entry is missing.
    """
    text = read_text_file(path, LARGEST_BYTES, "the directory of a run with its journals")
    for number, line in enumerate(text.split("\n")[:-1]):
        try:
            entry = json.loads(line)
            found, kind = entry["n"], entry["kind"]
        except (ValueError, TypeError, KeyError, RecursionError):
            raise InputError(f"{path}, line {number + 1}: found {line[:60]!r}, expected an entry") from None
        if not isinstance(kind, str):
            raise InputError(f"{path}, line {number + 1}: found the kind {kind!r:.60}, expected a word")
        if found != number:
            raise InputError(
                f"{path}, line {number + 1}: found entry {found!r:.60}, expected {number}; lines are missing"
            )
        yield entry
