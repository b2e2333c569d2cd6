"""What a page shows of the output, from the guard's journal: on, falling, off, or not known.

Of a ramp that is under way only its plan is written down; the steps as they were sent follow once it is over. On the
ramp nothing is measured, so a voltage from before it says nothing of the output, and is shown as one from before.
"""

import math
from collections import deque
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Any, NamedTuple

KEPT = 3000
"""Measurements on a page."""
_DRAWN = 20
"""Pieces of a ramp that is under way."""
_SILENT_S = 1.0
"""A guard measures many times a second; what it said longer ago is told with its age."""

Point = tuple[float, float]


class Phase(Enum):
    """What is known of the output."""

    ON = auto()
    FALLING = auto()
    DISCHARGING = auto()
    OFF = auto()
    UNKNOWN = auto()


_IS_OFF = (Phase.DISCHARGING, Phase.OFF)


class Word(NamedTuple):
    """What the guard said last.

    Attributes:
        time_s: when.
        state: a few words.
        phase: of the output.
        reason: why the run was ended, "" where nothing has ended it.
    """

    time_s: float
    state: str
    phase: Phase
    reason: str = ""


STATES = {
    "opened": ("supply found", Phase.ON),
    "armed": ("armed", Phase.ON),
    "trip": ("tripped", Phase.ON),
    "ramp": ("coming down, voltage falling", Phase.FALLING),
    "ramp_broken": ("coming down, the link to the source broke on the way", Phase.FALLING),
    "not_confirmed": ("coming down, not confirmed off yet", Phase.FALLING),
    "output_off": ("output off, voltage falling", Phase.DISCHARGING),
    "overdue": ("output off, but its terminals are live: do not touch them", Phase.DISCHARGING),
    "harmless": ("output off, harmless", Phase.OFF),
    "refused": ("refused", Phase.ON),
}
"""What the newest entry of the guard's journal of these kinds says of the output."""
NOT_ARMED = Word(-math.inf, "not armed", Phase.ON)


@dataclass(slots=True)
class OutputView:
    """The output of one run; all times are those of the journal.

    Attributes:
        said: the words of the guard, oldest first.
        measured: time and volts.
        sent: time and volts of every step on the way down.
        heard_s: the newest entry of any kind.
        is_over: the last word has been said.
    """

    said: list[Word] = field(default_factory=lambda: [NOT_ARMED])
    measured: deque[Point] = field(default_factory=lambda: deque(maxlen=KEPT))
    sent: list[Point] = field(default_factory=list)
    heard_s: float = -math.inf
    is_over: bool = False
    _alarm: Word | None = None
    _begun_s: float = -math.inf
    _plan: tuple[float, float, float] | None = None

    def take(self, entry: dict[str, Any], *, is_spare: bool = False) -> None:
        """Take an entry of the guard's journal, or of that of a spare one."""
        time_s = number(entry.get("t"))
        if time_s is None:
            return
        self.heard_s, kind = max(self.heard_s, time_s), entry["kind"]
        if kind in ("measured", "discharging", "harmless"):
            self._measure(time_s, entry.get("supply_voltage_V" if kind == "measured" else "measured_V"))
        elif kind == "ramp":
            self._begin(time_s, entry)
        elif kind == "came_down":
            self._came_down(entry.get("steps"))
        elif kind in ("ramp_broken", "output_off"):
            self._stop_plan(time_s)
            self.sent += [(time_s, 0.0)] if kind == "output_off" else []
        self._say(time_s, entry, is_spare=is_spare)

    def end(self, entry: dict[str, Any]) -> None:
        """Take the end that the controller wrote: no guard may have been left to say it."""
        self.is_over = True
        if entry.get("alarm"):
            self._alarm = Word(number(entry.get("t")) or self.heard_s, str(entry["alarm"]), Phase.UNKNOWN)

    def at(self, time_s: float) -> Word:
        """Return what was said last until a time."""
        if self._alarm is not None and self._alarm.time_s <= time_s:
            return self._alarm
        return next((word for word in reversed(self.said) if word.time_s <= time_s), self.said[0])

    def state(self, time_s: float, now_s: float | None) -> str:
        """Return what is said of the guard: its state, for how long it has been silent, and why it ended the run.

        Args:
            time_s: of which something is said.
            now_s: the clock of the journals; None for a run that is shown again.
        """
        word = self.at(time_s)
        silent_s = 0.0 if now_s is None or self.is_over or word.state != "armed" else now_s - self.heard_s
        silence = f", silent for {silent_s:.0f} s" if silent_s > _SILENT_S else ""
        return f"{word.state}{silence}{f' ({word.reason})' if word.reason else ''}"

    def command(self, time_s: float) -> str | None:
        """Return what the output is told since the guard brings it down; None while the controller commands."""
        phase = self.at(time_s).phase
        if phase is Phase.FALLING:
            steps = self.descent(time_s)
            return f"falling, {steps[-1][1]:.2f} V" if steps else "falling"
        return {Phase.ON: None, Phase.UNKNOWN: "not known"}.get(phase, "off")

    def voltage(self, time_s: float) -> str:
        """Return the newest measurement, and what it says of the output as it is now."""
        phase = self.at(time_s).phase
        volts = next((volts for at_s, volts in reversed(self.measured) if at_s <= time_s), None)
        if phase in _IS_OFF:
            off_s = next(word.time_s for word in self.said if word.phase in _IS_OFF)
            after = next((v for at_s, v in reversed(self.measured) if off_s <= at_s <= time_s), None)
            word = "off" if phase is Phase.OFF else "falling"
            return f"{word}, not measured" if after is None else f"{word}, {_volts(after)}"
        if phase is Phase.ON:
            return "-" if volts is None else _volts(volts)
        word = "falling" if phase is Phase.FALLING else "not known"
        return word if volts is None else f"{word}; {_volts(volts)} {'before' if phase is Phase.FALLING else 'last'}"

    def descent(self, time_s: float) -> list[Point]:
        """Return the way down until a time: what was sent, or what is planned while it is not over."""
        planned = [] if self._plan is None else _planned(self._plan, time_s)
        return [x for x in [*self.sent, *planned] if x[0] <= time_s]

    @property
    def falls_s(self) -> float:
        """When the way down began, infinite before."""
        return next((word.time_s for word in self.said if word.phase is Phase.FALLING), math.inf)

    @property
    def is_armed(self) -> bool:
        """Whether a guard has switched the output on, at any time."""
        return any(word.state == STATES["armed"][0] for word in self.said)

    @property
    def is_coming_down(self) -> bool:
        """Whether the voltage changes although nothing is written: the clock goes on."""
        return self.said[-1].phase in (Phase.FALLING, Phase.DISCHARGING) and not self.is_over

    @property
    def newest_s(self) -> float:
        """Time of the newest point of a chart."""
        ends = [line[-1][0] for line in (self.measured, self.sent) if line]
        return max([*ends, self.at(math.inf).time_s])

    def _measure(self, time_s: float, value: object) -> None:
        volts = number(value)
        if volts is not None:
            self.measured.append((time_s, volts))

    def _begin(self, time_s: float, entry: dict[str, Any]) -> None:
        # what a guard that was lost has sent is not known: its plan stands until another one comes
        self._stop_plan(time_s)
        self._begun_s = time_s
        from_V, rate_V_per_s = number(entry.get("from_V")), number(entry.get("rate_V_per_s"))
        if from_V is not None and rate_V_per_s is not None and rate_V_per_s > 0.0:
            self._plan = time_s, from_V, rate_V_per_s

    def _stop_plan(self, time_s: float) -> None:
        if self._plan is not None:
            self.sent += _planned(self._plan, time_s)
            self._plan = None

    def _came_down(self, steps: object) -> None:
        """Take the steps as they were sent, in place of what was planned."""
        off = self.said[-1]
        self._plan, self.sent = None, [x for x in self.sent if x[0] < self._begun_s]
        self.sent += _points(steps)
        if off.phase is Phase.DISCHARGING:
            self.sent.append((off.time_s, 0.0))

    def _say(self, time_s: float, entry: dict[str, Any], *, is_spare: bool) -> None:
        kind, before = entry["kind"], self.said[-1]
        reason = before.reason or ("guard_gone: the guard has gone, another one makes safe" if is_spare else "")
        if kind == "trip":
            reason = f"{entry.get('code')}: {entry.get('sentence')}"
        elif kind == "refused":
            reason = str(entry.get("sentence"))
        if kind in STATES:
            self.said.append(Word(time_s, *STATES[kind], reason))
        elif kind == "end":
            self.is_over = True
            if entry.get("alarm"):
                self.said.append(Word(time_s, str(entry["alarm"]), Phase.UNKNOWN))
            elif before.phase is Phase.DISCHARGING:
                self.said.append(Word(time_s, "output off", Phase.OFF, reason))


def _planned(plan: tuple[float, float, float], until_s: float) -> list[Point]:
    """Return the points of a planned ramp until a time, the last of them at that time."""
    begin_s, from_V, rate_V_per_s = plan
    whole_s = abs(from_V) / rate_V_per_s
    passed_s = min(max(until_s - begin_s, 0.0), whole_s)
    share = passed_s / whole_s if whole_s > 0.0 else 1.0
    parts = [share * k / _DRAWN for k in range(_DRAWN + 1)] if whole_s > 0.0 else [1.0]
    return [(begin_s + x * whole_s, (1.0 - x) * from_V) for x in parts]


def _points(steps: object) -> list[Point]:
    """Return the steps of an entry that are numbers."""
    found: list[Point] = []
    for step in steps if isinstance(steps, list) else ():
        if isinstance(step, list) and len(step) == 2:
            time_s, volts = number(step[0]), number(step[1])
            if time_s is not None and volts is not None:
                found.append((time_s, volts))
    return found


def _volts(value: float) -> str:
    return f"{value + 0.0:.2f} V" if abs(value) >= 0.005 else "0.00 V"


def number(value: object) -> float | None:
    """Return a finite number of a journal, None for anything else."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
