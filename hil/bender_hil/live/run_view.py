"""What a page shows of a run, read from its journals while they grow.

A line that is not whole yet is left for the next look. The times of a run count from its first frame.
"""

import json
import math
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bender_hil.live.output_view import OutputView, Point, number
from bender_hil.live.watch_view import WATCH, WatchView
from bender_hil.log.read_run import GUARD, RUN

KEPT = 3000
"""Ticks on a page: a minute and a half at 30 frames per second."""
DECISIONS = "journal.jsonl"
_LARGEST_READ = 1 << 22
_ROUNDING_S = 1e-6
SPARES = "rescue*.jsonl"
"""Journals of spare guards."""


@dataclass(slots=True)
class Tail:
    """The whole lines of a growing journal, each once."""

    path: Path
    _offset: int = 0

    def entries(self) -> list[dict[str, Any]]:
        """Return the entries that are new since the last look; damaged lines are left out."""
        try:
            with self.path.open("rb") as file:
                file.seek(self._offset)
                data = file.read(_LARGEST_READ)
        except OSError:
            return []
        end = data.rfind(b"\n") + 1
        self._offset += end
        found = []
        for line in data[:end].splitlines():
            try:
                entry = json.loads(line)
            except ValueError:
                continue
            if isinstance(entry, dict) and isinstance(entry.get("kind"), str):
                found.append(entry)
        return found


@dataclass(slots=True)
class Row:
    """One tick as it is drawn; None where nothing is known."""

    time_s: float
    setpoint_um: float | None
    tip_um: float | None
    command_V: float | None
    latency_ms: float | None
    is_late: bool
    frame: int = 0
    sequence: int = -1


@dataclass(slots=True)
class RunView:
    """One run.

    Attributes:
        folder: of the run.
        rows: the newest ticks.
        output: what its guard says of the output.
        ticks, late, lost: counts over the whole run.
        emulated: whether the bench is; None before it is known.
        watch: what `bender watch` says of it.
    """

    folder: Path
    rows: deque[Row] = field(default_factory=lambda: deque(maxlen=KEPT))
    output: OutputView = field(default_factory=OutputView)
    ticks: int = 0
    late: int = 0
    lost: int = 0
    emulated: bool | None = None
    watch: WatchView = field(default_factory=WatchView)
    _origin_s: float | None = None
    _run: Tail | None = None
    _guard: Tail | None = None
    _watch: Tail | None = None
    _spares: dict[Path, Tail] = field(default_factory=dict)

    def update(self) -> "RunView":
        """Read what is new; returns itself."""
        self._run = self._run or Tail(self.folder / RUN)
        self._guard = self._guard or Tail(self.folder / GUARD)
        self._watch = self._watch or Tail(self.folder / WATCH)
        told = self._run.entries()
        for entry in self._guard.entries():
            self.output.take(entry)
        for path in sorted(self.folder.glob(SPARES), key=lambda x: (len(x.name), x.name)):
            for entry in self._spares.setdefault(path, Tail(path)).entries():
                self.output.take(entry, is_spare=True)
        for entry in told:
            if entry["kind"] == "tick":
                self._tick(entry)
            elif entry["kind"] == "start":
                self.emulated = bool(entry.get("emulated"))
            elif entry["kind"] == "stop":
                self.output.end(entry)
                self._count_late(entry.get("late_ticks"))
        for entry in self._watch.entries():
            self.watch.take(entry)
        return self

    def _tick(self, entry: dict[str, Any]) -> None:
        grabbed_s, sent_s = number(entry.get("grabbed_s")), number(entry.get("sent_s"))
        if grabbed_s is None:
            return
        if self._origin_s is None:
            self._origin_s = grabbed_s
        tip_um = number(entry.get("measured_um"))
        self.ticks += 1
        self.late += bool(entry.get("late"))
        self.lost += tip_um is None
        self.rows.append(
            Row(
                grabbed_s - self._origin_s,
                number(entry.get("setpoint_um")),
                tip_um,
                number(entry.get("command_V")),
                None if sent_s is None else 1e3 * (sent_s - grabbed_s),
                bool(entry.get("late")),
                int(number(entry.get("frame")) or 0),
                -1 if entry.get("sequence") is None else int(number(entry.get("sequence")) or 0),
            )
        )

    def _count_late(self, late: object) -> None:
        """Take which ticks were late by both journals; a tick that is written knows only when it was sent."""
        if not isinstance(late, list):
            return
        self.late = len(late)
        for row in self.rows:
            row.is_late = row.sequence in late

    def clock_s(self, time_s: float) -> float:
        """Return the time of the journals for a time of the run; the newest of them before its first frame."""
        return math.inf if self._origin_s is None else self._origin_s + time_s + _ROUNDING_S

    def now_s(self, clock_s: float) -> float:
        """Return the time of a run that goes on: of its newest entry, or the clock's while the voltage falls unwritten.

        Args:
            clock_s: the clock of the journals.
        """
        if self._origin_s is None or not self.output.is_coming_down:
            return self.duration_s
        return max(self.duration_s, clock_s - self._origin_s)

    def up_to(self, time_s: float) -> list[Row]:
        """Return the ticks until a time of the run."""
        return [x for x in self.rows if x.time_s <= time_s]

    def measured(self, begin_s: float, end_s: float) -> list[Point]:
        """Return time of the run and volts between two times of it."""
        return self._of_run([x for x in self.output.measured if x[0] <= self.clock_s(end_s)], begin_s)

    def descent(self, begin_s: float, end_s: float) -> list[Point]:
        """Return what the output was told on the way down, which no tick commands."""
        return self._of_run(self.output.descent(self.clock_s(end_s)), begin_s)

    @property
    def falls_s(self) -> float:
        """Time of the run at which the way down began, infinite before."""
        return self.output.falls_s - (self._origin_s or 0.0)

    def _of_run(self, points: list[Point], begin_s: float) -> list[Point]:
        origin_s = self._origin_s
        return [] if origin_s is None else [(t - origin_s, v) for t, v in points if t - origin_s >= begin_s]

    @property
    def duration_s(self) -> float:
        """Length of the run so far, the way down included."""
        if self._origin_s is None or not self.rows:
            return 0.0
        return max(self.rows[-1].time_s, self.output.newest_s - self._origin_s)


def whole_run(folder: Path) -> RunView:
    """Return a past run with all of its ticks."""
    view = RunView(folder, deque(), OutputView(measured=deque()), watch=WatchView(deque()))
    while True:
        before = view.ticks, view.output.heard_s, len(view.watch.stretches)
        view.update()
        if before == (view.ticks, view.output.heard_s, len(view.watch.stretches)):
            return view


def newest_run(folder: Path) -> Path | None:
    """Return the folder of the run that began last: this one, or a play of an investigation in it; None for none."""
    if (folder / RUN).exists():
        return folder
    plays = sorted(path.parent for path in folder.glob(f"[0-9][0-9]-*/{RUN}"))
    return plays[-1] if plays else None


def decisions(folder: Path) -> list[str]:
    """Return the newest decisions of an investigation, the last one first; none of a plain run."""
    found = Tail(folder / DECISIONS).entries()
    return [f"{x['kind']}: {x.get('why', '')}" for x in reversed(found[-8:])]
