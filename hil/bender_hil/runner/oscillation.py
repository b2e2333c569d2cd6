"""Oscillation: more swings of the tip or the command than the set-point explains.

A swing runs from one turning point to the next over at least a share of the range; smaller ones are noise. A loop that
is tuned to quarter decay (Ziegler and Nichols, Trans. ASME 64 (1942), 759: each overshoot half as far as the swing
before it, the least damped loop that is usually accepted) makes log2(1.5 / 0.05) = 4.9 swings over 5 % of the range
after a step over the whole of it. So a move of the set-point excuses five swings. The swings without an excuse are
summed up and never fall below minus five (a one-sided cumulative sum, Page, Biometrika 41 (1954), 100), which lets a
loop oscillate under a moving set-point no more than under a still one. Ten are a limit cycle.
"""

import math
from dataclasses import dataclass

from bender_hil.guard.rules import Trip
from bender_hil.guard.settings import GuardSettings
from bender_hil.runner.program import Decision
from bender_hil.runner.tip_camera import Sight

SHARE = 0.05
AIM_SHARE = 0.25
"""Smaller moves of the set-point count: it has no noise, and quarter decay magnifies a square wave threefold."""
EXCUSED = 5
MOST = 10


class Swings:
    """Counts the turning points of a signal that lie at least `least` apart.

    Args:
        least: size of the smallest swing.
        start: value before the first.
    """

    def __init__(self, least: float, start: float = 0.0) -> None:
        self._least = least
        self._low = self._high = start
        self._direction = 0

    def add(self, value: float) -> bool:
        """Take the next value; returns whether a swing the other way, or the first one, is seen to be under way."""
        self._low, self._high = min(self._low, value), max(self._high, value)
        has_fallen = self._direction >= 0 and value <= self._high - self._least
        has_risen = self._direction <= 0 and value >= self._low + self._least
        if not (has_fallen or has_risen):
            return False
        self._direction = -1 if has_fallen else 1
        self._low = self._high = value
        return True


@dataclass(frozen=True, slots=True)
class Ranges:
    """What swings are held against: the travel of the tip and the range of the command."""

    travel_um: float
    command_V: float


def ranges_of(limits: GuardSettings) -> Ranges:
    """Return the ranges that a guard's limits give to tip and command."""
    low_um, high_um = limits.travel_um
    return Ranges(high_um - low_um, limits.maximum_V - limits.minimum_V)


class OscillationWatch:
    """Follows one closed loop, tick by tick.

    Args:
        ranges: of tip and command.

    Attributes:
        tip_swings, command_swings: so many without an excuse at present; negative where the set-point has just moved.
        worst: the most there ever were, of either.
    """

    def __init__(self, ranges: Ranges) -> None:
        least_um = SHARE * ranges.travel_um
        self._least_aim_um = AIM_SHARE * least_um
        self._tip, self._command = Swings(least_um), Swings(SHARE * ranges.command_V)
        self._aim = Swings(self._least_aim_um)
        self._before_um = self._rate_um = 0.0
        self.tip_swings = self.command_swings = 0
        self.worst = 0

    def see(self, sight: Sight, decision: Decision) -> Trip | None:
        """Take a tick of the loop; an open loop, which has no set-point, cannot oscillate."""
        if decision.setpoint_um is None:
            return None
        sentence = self.add(decision.setpoint_um, sight.tip_um, decision.voltage_V)
        return None if sentence is None else Trip("oscillation", sentence)

    def add(self, setpoint_um: float, tip_um: float | None, command_V: float) -> str | None:
        """Take a tick; returns a sentence when the loop oscillates, None as long as it does not."""
        rate_um, self._rate_um = self._rate_um, setpoint_um - self._before_um
        self._before_um = setpoint_um
        # a steady slope is followed without ringing; a jump is a sudden change of it
        has_turned, has_jumped = self._aim.add(setpoint_um), abs(self._rate_um - rate_um) >= self._least_aim_um
        if has_turned or has_jumped:
            self.tip_swings = max(-EXCUSED, self.tip_swings - EXCUSED)
            self.command_swings = max(-EXCUSED, self.command_swings - EXCUSED)
        if tip_um is not None and math.isfinite(tip_um):
            self.tip_swings += self._tip.add(tip_um)
        self.command_swings += self._command.add(command_V)
        count = max(self.tip_swings, self.command_swings)
        self.worst = max(self.worst, count)
        if count < MOST:
            return None
        what = "tip" if self.tip_swings >= self.command_swings else "command"
        return f"the {what} swung {count} times to and fro that the set-point does not explain, allowed: {MOST - 1}"
