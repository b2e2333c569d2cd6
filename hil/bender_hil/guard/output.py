"""The guarded output: clamps, the slew limit, and what is asked of the supply between commands."""

import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from bender_hil.guard.played import Played, refused
from bender_hil.guard.rules import Situation, Trip
from bender_hil.guard.settings import GuardSettings
from bender_hil.guard.slew import SlewLimit
from bender_hil.log.journal import Journal
from bender_hil.recent_range import RecentRange
from bender_hil.supply.played_source import can_play
from bender_hil.supply.source import Source

_PATROL_S = 0.006
"""So much of a frame may be spent on questions after a command."""
_FORGET = 0.9
"""The longest question of late and the shortest time between commands count; each one after them fades them."""
_MARGIN = 1.1
"""Of the time that a question is given."""
_SELDOM_S = 0.05
"""A supply is asked so often whatever the rhythm of the commands leaves."""


class GuardedOutput:
    """The supply's output during a run.

    Args:
        source: armed.
        limits: what to hold it to.
        journal: every change is written there.
        situation: what is measured goes there.

    Attributes:
        voltage_V: what the supply was told last.
        clamped: commands that lay outside the limits.
        slowed: commands that were slower than asked for.
    """

    def __init__(self, source: Source, limits: GuardSettings, journal: Journal, situation: Situation) -> None:
        self._source, self._limits, self._journal, self._situation = source, limits, journal, situation
        self.voltage_V = self._wanted_V = 0.0
        self.clamped = self.slowed = 0
        self._sequence: int | None = None
        self._slew = SlewLimit(limits.slew_V_per_s, limits.burst_s, time.perf_counter())
        self._told = RecentRange(limits.settle_s)
        self._told.add(-math.inf, 0.0)
        self._questions: deque[Callable[[], Trip | None]] = deque(
            [
                self._measure, self._check_setting, self._measure, self._check_current,
                self._measure, self._check_switch, self._measure, self._check_protection,
            ]
        )  # fmt: skip
        self._asked_s = -math.inf
        self._question_s = 0.0
        self._commanded_s, self._period_s = -math.inf, math.inf
        self._high_since_s: float | None = None
        self._played: Played | None = None
        self._followed = 0

    def play(self, levels_V: Any, rate_Hz: Any) -> Trip | float:
        """Let the source play levels from 0 V on; returns when the first began, or why they may not. SupplyError."""
        trip = refused(levels_V, rate_Hz, self._limits)
        if trip is not None:
            return trip
        if self.voltage_V != 0.0 or self._played is not None:
            return Trip("bad_command", "the controller wanted to play, but the output is not at rest")
        if not can_play(self._source):
            return Trip("profile", "this source has no buffer to play from")
        start_s = self._source.play(levels_V, rate_Hz)
        self._played = Played(levels_V, float(rate_Hz), start_s)
        self._journal.write("play", levels=len(levels_V), rate_Hz=rate_Hz, start_s=start_s)
        return start_s

    def command(self, wanted_V: float, sequence: int) -> None:
        """Take a finite command; what it asks beyond the limits is counted and written down. SupplyError."""
        now_s = time.perf_counter()
        # a command that came late says nothing of when the next one comes
        self._period_s = min(now_s - self._commanded_s, self._period_s / _FORGET)
        self._commanded_s = now_s
        inside_V = min(max(wanted_V, self._limits.minimum_V), self._limits.maximum_V)
        if inside_V != wanted_V:
            self.clamped += 1
            self._journal.write("clamped", sequence=sequence, wanted_V=wanted_V, clamped_V=inside_V)
        self._wanted_V, self._sequence = inside_V, sequence
        self._approach(first=True)

    def continue_slew(self) -> None:
        """Go on towards a command that the slew limit held back, or follow what is played. SupplyError."""
        self._follow()
        if self._played is None and self.voltage_V != self._source.rounded(self._wanted_V):
            self._approach(first=False)

    def patrol(self, is_wanted: Callable[[], bool]) -> Trip | None:
        """Measure and ask, one question after the other, for as long as nothing else is to do. SupplyError.

        No question is begun that would still be open when the next command is due, in the rhythm of those before. A
        supply that takes long for its answers is asked less often, but never less than once in a settling time.

        Args:
            is_wanted: whether a message of the controller is waiting.
        """
        end_s = time.perf_counter() + _PATROL_S
        is_overdue = time.perf_counter() - self._asked_s > self._limits.settle_s
        for _ in range(len(self._questions)):
            now_s = time.perf_counter()
            if not is_overdue and (is_wanted() or now_s > end_s or self._would_delay(now_s)):
                break
            is_overdue = False
            question = self._questions[0]
            self._questions.rotate(-1)
            self._asked_s = now_s
            trip = question()
            self._question_s = max(time.perf_counter() - now_s, _FORGET * self._question_s)
            if trip is not None:
                return trip
        return None

    def _would_delay(self, now_s: float) -> bool:
        """Whether a question that begins now would still be open when the next command comes."""
        due_s = self._commanded_s + self._period_s
        return now_s - self._asked_s < _SELDOM_S and now_s < due_s < now_s + _MARGIN * self._question_s

    def idle_s(self) -> float:
        """How long the supply was asked nothing."""
        return time.perf_counter() - self._asked_s

    def _follow(self) -> None:
        """Write down which levels of the buffer have begun since, and that the output is there."""
        played = self._played
        if played is None:
            return
        passed = played.passed(time.perf_counter())
        for place in range(self._followed, passed):
            level_V, begins_s = played.levels_V[place], played.begins_s(place)
            self.voltage_V = self._wanted_V = level_V
            self._told.add(begins_s, level_V)
            self._journal.write("applied", sequence=place, voltage_V=level_V, command_time_s=begins_s, whole=True)
        self._followed = max(self._followed, passed)
        self._sequence = self._followed - 1

    def _approach(self, first: bool) -> None:
        now_s = time.perf_counter()
        level_V = self._source.rounded(self._slew.allowed(self.voltage_V, self._wanted_V, now_s))
        if first and level_V != self._source.rounded(self._wanted_V):
            self.slowed += 1
        if not first and level_V == self.voltage_V:
            return
        sent_s = self._source.set_voltage(level_V)
        self._slew.take(level_V - self.voltage_V)
        self.voltage_V = level_V
        self._told.add(sent_s, level_V)
        self._journal.write("applied", sequence=self._sequence, voltage_V=level_V, command_time_s=sent_s, whole=first)

    def _measure(self) -> None:
        """The voltage at the terminals; whether it is in its band is judged with everything else."""
        situation = self._situation
        asked_s = time.perf_counter()
        situation.measured_V = self._source.measured_V()
        self._follow()
        situation.lowest_V, situation.highest_V = self._told.range(asked_s)
        self._journal.write(
            "measured", sequence=self._sequence, supply_voltage_V=situation.measured_V, current_A=situation.measured_A
        )

    def _check_setting(self) -> Trip | None:
        if self._played is not None:
            return None
        found_V = self._source.voltage_setting_V()
        if abs(found_V - self.voltage_V) > self._source.setting_tolerance_V:
            return Trip("setting", f"the supply is set to {found_V:g} V, it was told {self.voltage_V:g} V")
        return None

    def _check_current(self) -> Trip | None:
        found_A = self._source.measured_A()
        self._situation.measured_A = found_A
        now_s = time.perf_counter()
        if found_A is None or abs(found_A) <= self._limits.current_trip_A:
            self._high_since_s = None
        elif self._high_since_s is None:
            self._high_since_s = now_s
        self._situation.high_for_s = 0.0 if self._high_since_s is None else now_s - self._high_since_s
        return None

    def _check_switch(self) -> Trip | None:
        return None if self._source.is_on() else Trip("output_off", "the output was switched off by something else")

    def _check_protection(self) -> Trip | None:
        return Trip("protection", "the overvoltage protection has tripped") if self._source.has_tripped() else None
