"""Rows from the journals of a run on the bench, finished or going on, by the rule of `bender_hil.log.to_record`.

A row is complete when the next frame is there and the guard has taken a later command: its voltage and the time from
which that acts are known then.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bender_hil.log.read_run import GUARD, RUN
from bender_hil.log.to_record import mean_time_s
from bender_loop.errors import InputError
from bender_watch.follow.rows import Rows

Entry = dict[str, Any]


def is_run(path: Path) -> bool:
    """Return whether a directory is that of a run."""
    return (path / RUN).is_file()


@dataclass(slots=True)
class _Journal:
    path: Path
    offset: int = 0
    rest: bytes = b""

    def further(self) -> list[Entry]:
        """Return the entries that were written since the last time."""
        if not self.path.is_file():
            return []
        with self.path.open("rb") as file:
            file.seek(self.offset)
            data = file.read()
        self.offset += len(data)
        *whole, self.rest = (self.rest + data).split(b"\n")
        found: list[Any]
        try:
            found = [json.loads(line) for line in whole if line.strip()]
        except (ValueError, RecursionError):
            found = [None]
        if not all(isinstance(x, dict) and isinstance(x.get("kind"), str) for x in found):
            raise InputError(f"{self.path}: found a line that is no entry, expected the journal of a run")
        return found


@dataclass(slots=True)
class RunRows:
    """The rows of a run as they become complete.

    Attributes:
        path: directory of the run.
        ended: the run is over.
    """

    path: Path
    ended: bool = False
    _run: _Journal = field(init=False)
    _guard: _Journal = field(init=False)
    _ticks: list[Entry] = field(default_factory=list)
    _applied: dict[int, list[Entry]] = field(default_factory=dict)
    _delay_s: float = 0.0
    _origin_s: float | None = None
    _level_V: float = 0.0

    def __post_init__(self) -> None:
        self._run, self._guard = _Journal(self.path / RUN), _Journal(self.path / GUARD)

    def further(self) -> Rows | None:
        """Return the rows that have become complete since the last time; None for none.

        Raises:
            InputError: a journal is damaged.
        """
        try:
            self._take(self._guard.further(), self._run.further())
            return self._complete()
        except InputError:
            raise
        except (LookupError, TypeError, ValueError) as problem:
            found = f"found an entry without what a run writes ({type(problem).__name__}: {problem})"
            raise InputError(f"{self.path}: {found}, expected the journals of a run") from None

    def _take(self, applied: list[Entry], told: list[Entry]) -> None:
        for entry in applied:
            if entry["kind"] == "applied":
                self._applied.setdefault(entry["sequence"], []).append(entry)
        for entry in told:
            if entry["kind"] == "start":
                self._delay_s = float(entry.get("delay_s") or 0.0)
            elif entry["kind"] == "tick":
                if not self._ticks or entry["grabbed_s"] > self._ticks[-1]["grabbed_s"]:
                    self._ticks.append(entry)
            elif entry["kind"] == "stop":
                self.ended = True

    def _complete(self) -> Rows | None:
        taken = max(self._applied, default=-1)
        # until the guard has taken a later command, further parts of one that the slew limit divides may come
        known = [x for x in self._ticks if x["sequence"] < taken + self.ended]
        count = len(known) if self.ended else min(len(known), len(self._ticks) - 1)
        rows = known[: max(count, 0)]
        if not rows:
            return None
        if self._origin_s is None:
            self._origin_s = float(rows[0]["grabbed_s"]) - self._delay_s
        found = []
        for k, row in enumerate(rows):
            parts = self._applied.get(row["sequence"], [])
            acting_s = (mean_time_s(parts, self._level_V) if parts else row["sent_s"]) - self._origin_s
            self._level_V = float(parts[-1]["voltage_V"]) if parts else self._level_V
            time_s = row["grabbed_s"] - self._delay_s - self._origin_s
            following = (
                self._ticks[k + 1]["grabbed_s"] - self._delay_s - self._origin_s if k + 1 < len(self._ticks) else np.inf
            )
            read = np.nan if row["measured_um"] is None else float(row["measured_um"])
            found.append((time_s, self._level_V, read, min(max(acting_s, time_s), following)))
        self._ticks = self._ticks[len(rows) :]
        for sequence in [x for x in self._applied if x <= rows[-1]["sequence"]]:
            if sequence != taken:
                del self._applied[sequence]
        time_s, voltage_V, read, acting_s = np.array(found).T
        return Rows(time_s, voltage_V, read, acting_s)
