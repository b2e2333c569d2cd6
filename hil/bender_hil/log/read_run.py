"""A run's directory, read back: ticks of the controller beside what the guard did with them."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bender_hil.log.journal import Entry, read_journal
from bender_loop.errors import InputError

RUN, GUARD = "run.jsonl", "guard.jsonl"


@dataclass(frozen=True, slots=True)
class RunLog:
    """What was written down.

    Attributes:
        directory: of the run.
        start: the first entry of the controller.
        ticks: its ticks in their order.
        events: everything else of the controller.
        guard: every entry of the guard.
    """

    directory: Path
    start: Entry
    ticks: tuple[Entry, ...]
    events: tuple[Entry, ...]
    guard: tuple[Entry, ...]

    def guard_entry(self, kind: str) -> Entry | None:
        """The first entry of that kind of the guard."""
        return next((entry for entry in self.guard if entry["kind"] == kind), None)

    def by_sequence(self, kind: str) -> dict[int, Entry]:
        """The guard's last entries of that kind by the tick that they belong to."""
        return {entry["sequence"]: entry for entry in self.guard if entry["kind"] == kind}

    def all_by_sequence(self, kind: str) -> dict[int, list[Entry]]:
        """The guard's entries of that kind by the tick that they belong to, in their order."""
        found: dict[int, list[Entry]] = {}
        for entry in self.guard:
            if entry["kind"] == kind:
                found.setdefault(entry["sequence"], []).append(entry)
        return found


@contextlib.contextmanager
def malformed_is_bad_input(directory: Path) -> Iterator[None]:
    """Raise InputError where an entry of the logs lacks something or holds what it cannot."""
    try:
        yield
    except (LookupError, TypeError, ValueError, ArithmeticError, AttributeError, RecursionError) as error:
        reason = f"{type(error).__name__}: {error}"[:120]
        raise InputError(f"{directory}: its log does not say what the run did ({reason})") from error


def read_run(directory: Path) -> RunLog:
    """Read the journals of a run.

    Raises:
        InputError: there is no run in the directory, or a journal is damaged.
    """
    entries = list(read_journal(directory / RUN))
    if not entries or entries[0]["kind"] != "start":
        raise InputError(f"{directory / RUN}: found no start of a run in the first line")
    guard_path = directory / GUARD
    guard: tuple[Any, ...] = tuple(read_journal(guard_path)) if guard_path.exists() else ()
    ticks = tuple(entry for entry in entries if entry["kind"] == "tick")
    events = tuple(entry for entry in entries[1:] if entry["kind"] != "tick")
    return RunLog(directory, entries[0], ticks, events, guard)
