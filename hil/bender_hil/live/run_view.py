"""What a page shows of a run, read from its journals while they grow.

A line that is not whole yet is left for the next look. The times of a run count from its first frame.
"""

import json
import math
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bender_hil.live.watch_view import WATCH, WatchView
from bender_hil.log.read_run import GUARD, RUN

KEPT = 3000
"""Ticks on a page: a minute and a half at 30 frames per second."""
DECISIONS = "journal.jsonl"
_LARGEST_READ = 1 << 22
_DRAWN = 10
"""Pieces of the ramp down on the chart."""
STATES = {
    "opened": "supply found",
    "armed": "armed",
    "trip": "tripped",
    "ramp": "coming down",
    "output_off": "output off",
    "harmless": "output off, harmless",
    "refused": "refused",
}
"""What the newest entry of the guard's journal of these kinds says of it."""
_TIMED = ("measured", "harmless", "ramp", "output_off")
"""Entries with a time, which is known once a first frame is."""


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


@dataclass(slots=True)
class RunView:
    """One run.

    Attributes:
        folder: of the run.
        rows: the newest ticks.
        measured: time in s and volts, as the guard measured them.
        descent: time in s and volts of the guard's own way down, which no tick commands.
        off_s: time at which the supply confirmed that its output is off; None before.
        state: of the guard, a few words.
        reason: why it tripped, "" where it did not.
        ticks, late, lost: counts over the whole run.
        emulated: whether the bench is; None before it is known.
        is_over: the guard has written its end.
        watch: what `bender watch` says of it.
    """

    folder: Path
    rows: deque[Row] = field(default_factory=lambda: deque(maxlen=KEPT))
    measured: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=KEPT))
    descent: list[tuple[float, float]] = field(default_factory=list)
    off_s: float | None = None
    state: str = "not armed"
    reason: str = ""
    ticks: int = 0
    late: int = 0
    lost: int = 0
    emulated: bool | None = None
    is_over: bool = False
    watch: WatchView = field(default_factory=WatchView)
    _origin_s: float | None = None
    _run: Tail | None = None
    _guard: Tail | None = None
    _watch: Tail | None = None
    _waiting: list[dict[str, Any]] = field(default_factory=list)

    def update(self) -> "RunView":
        """Read what is new; returns itself."""
        self._run = self._run or Tail(self.folder / RUN)
        self._guard = self._guard or Tail(self.folder / GUARD)
        self._watch = self._watch or Tail(self.folder / WATCH)
        for entry in self._run.entries():
            if entry["kind"] == "tick":
                self._tick(entry)
            elif entry["kind"] == "start":
                self.emulated = bool(entry.get("emulated"))
        for entry in self._watch.entries():
            self.watch.take(entry)
        self._waiting += self._guard.entries()
        for entry in self._waiting:
            self._said_by_guard(entry)
        self._waiting = [x for x in self._waiting if x["kind"] in _TIMED] if self._origin_s is None else []
        return self

    def _tick(self, entry: dict[str, Any]) -> None:
        grabbed_s, sent_s = _number(entry.get("grabbed_s")), _number(entry.get("sent_s"))
        if grabbed_s is None:
            return
        if self._origin_s is None:
            self._origin_s = grabbed_s
        tip_um = _number(entry.get("measured_um"))
        self.ticks += 1
        self.late += bool(entry.get("late"))
        self.lost += tip_um is None
        self.rows.append(
            Row(
                grabbed_s - self._origin_s,
                _number(entry.get("setpoint_um")),
                tip_um,
                _number(entry.get("command_V")),
                None if sent_s is None else 1e3 * (sent_s - grabbed_s),
                bool(entry.get("late")),
                int(_number(entry.get("frame")) or 0),
            )
        )

    def _said_by_guard(self, entry: dict[str, Any]) -> None:
        kind = entry["kind"]
        self.state = STATES.get(kind, self.state)
        if kind == "trip":
            self.reason = f"{entry.get('code')}: {entry.get('sentence')}"
        elif kind == "end":
            self.is_over = True
            if entry.get("alarm"):
                self.state, self.reason = "OUTPUT STATE UNKNOWN", str(entry["alarm"])
        time_s = _number(entry.get("t"))
        if time_s is None or self._origin_s is None:
            return
        if kind in ("measured", "harmless"):
            volts = _number(entry.get("supply_voltage_V" if kind == "measured" else "measured_V"))
            if volts is not None:
                self.measured.append((time_s - self._origin_s, volts))
        elif kind == "ramp":
            self._came_down(time_s - self._origin_s, _number(entry.get("from_V")), _number(entry.get("rate_V_per_s")))
        elif kind == "output_off":
            self.off_s = time_s - self._origin_s
            self.descent.append((self.off_s, 0.0))

    def _came_down(self, time_s: float, from_V: float | None, rate_V_per_s: float | None) -> None:
        if from_V is not None and rate_V_per_s is not None and rate_V_per_s > 0.0:
            parts = [k / _DRAWN for k in range(_DRAWN + 1)]
            self.descent = [(time_s + x * abs(from_V) / rate_V_per_s, (1.0 - x) * from_V) for x in parts]

    def up_to(self, time_s: float) -> tuple[list[Row], list[tuple[float, float]]]:
        """Return the ticks and the measured voltages until a time of the run, for its replay."""
        return [x for x in self.rows if x.time_s <= time_s], [x for x in self.measured if x[0] <= time_s]

    @property
    def duration_s(self) -> float:
        """Length of the run so far, the way down included."""
        ends = [x[-1] for x in (self.measured, self.descent) if x]
        return max([self.rows[-1].time_s if self.rows else 0.0, *(time_s for time_s, _ in ends)])


def whole_run(folder: Path) -> RunView:
    """Return a past run with all of its ticks."""
    view = RunView(folder, deque(), deque(), watch=WatchView(deque()))
    while True:
        before = view.ticks, len(view.measured), len(view.watch.stretches)
        view.update()
        if before == (view.ticks, len(view.measured), len(view.watch.stretches)):
            return view


def newest_run(folder: Path) -> Path | None:
    """Return the folder of the run that began last: this one, or a play of an investigation in it; None for none."""
    if (folder / RUN).exists():
        return folder
    plays = sorted(path.parent for path in folder.glob(f"[0-9][0-9]-*/{RUN}"))
    return plays[-1] if plays else None


def decisions(folder: Path, most: int = 8) -> list[str]:
    """Return the newest decisions of an investigation, the last one first; none of a plain run."""
    found = Tail(folder / DECISIONS).entries()
    return [f"{x['kind']}: {x.get('why', '')}" for x in reversed(found[-most:])]


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
