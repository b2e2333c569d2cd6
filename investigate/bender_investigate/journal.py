"""The decisions of an investigation: one line of JSON each, on the disk before what they decide is done.

A line is whole or not there: one that a crash cut short is taken away when the journal is opened again.
"""

import json
import os
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from bender_loop.errors import InputError, RunError
from bender_loop.shell.files import finite

JOURNAL = "journal.jsonl"
Decision = dict[str, Any]


class DecisionJournal:
    """The journal of one investigation, made or opened again.

    Args:
        path: of the file, in a directory that is there.

    Attributes:
        decisions: all of them, those of earlier sittings first.

    Raises:
        InputError: a line in the middle is damaged, or the file cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.decisions: list[Decision] = list(_whole(path))
        self._path = path
        flags = os.O_CREAT | os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0)
        try:
            self._file = os.open(path, flags, 0o644)
            os.ftruncate(self._file, path.read_bytes().rfind(b"\n") + 1)
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror}); choose another directory") from error

    def write(self, kind: str, why: str, **facts: Any) -> Decision:
        """Add a decision and wait until the disk has it; returns it.

        Raises:
            RunError: the disk is full.
        """
        when = datetime.now().astimezone().isoformat(timespec="milliseconds")
        decision = {"n": len(self.decisions), "when": when, "kind": kind, "why": why, **finite(facts)}
        line = _line(decision)
        try:
            if os.write(self._file, line) != len(line):
                raise OSError(28, "the disk is full")
            os.fsync(self._file)
        except OSError as error:
            raise RunError(f"{self._path}: a decision cannot be written ({error.strerror or error})") from error
        self.decisions.append(decision)
        return decision

    def last(self, kind: str) -> Decision | None:
        """Return the newest decision of a kind."""
        return next((x for x in reversed(self.decisions) if x["kind"] == kind), None)

    def all(self, kind: str) -> list[Decision]:
        """Return the decisions of a kind, in their order."""
        return [x for x in self.decisions if x["kind"] == kind]

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)


def read_decisions(path: Path) -> list[Decision]:
    """Return the decisions of a journal; a last line that is being written is left out.

    Raises:
        InputError: there is none, or a line is no decision.
    """
    if not path.is_file():
        raise InputError(f"{path.parent}: found no {path.name}, expected the directory of an investigation")
    return list(_whole(path))


def check_decisions(path: Path) -> None:
    """Make sure that an investigation can be gone on with.

    Raises:
        InputError: there is no journal, a line is no decision, or what was decided before is not in it any more.
    """
    if read_decisions(path):
        return
    content = path.read_bytes()
    others = [x.name for x in path.parent.iterdir() if x.is_dir()]
    if (content and not content.startswith(b"{")) or others:
        beside = f", beside {', '.join(sorted(others)[:3])}" if others else ""
        raise InputError(
            f"{path}: found no decision in {len(content)} bytes{beside}; what was played before is not known any more, "
            "begin a new investigation in another directory"
        )


def _line(decision: Decision) -> bytes:
    return json.dumps(decision, allow_nan=False).encode() + b"\n"


def _whole(path: Path) -> Iterator[Decision]:
    try:
        lines = path.read_bytes().split(b"\n")[:-1]
    except FileNotFoundError:
        return
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    for number, line in enumerate(lines):
        try:
            decision = json.loads(line)
            if decision["n"] != number or not isinstance(decision["kind"], str):
                raise ValueError
        except (ValueError, TypeError, KeyError, RecursionError):
            raise InputError(f"{path}, line {number + 1}: found {line[:60]!r}, expected decision {number}") from None
        yield decision
