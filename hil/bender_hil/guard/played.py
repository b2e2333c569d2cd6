"""Voltages that the source plays from its own buffer, by its own clock; nobody is asked between two of them.

They are judged before they begin, all of them, by the limits that hold for commands: what a command would be clamped
to or slowed down to is refused here, since nothing could be changed later.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from bender_hil.guard.rules import Trip
from bender_hil.guard.settings import GuardSettings
from bender_hil.guard.slew import SlewLimit

MOST_LEVELS = 1_000_000
_HIGHEST_HZ = 1e5
_CLOSE_V = 1e-9


class Played(NamedTuple):
    """Levels that began at `start_s` (`time.perf_counter`), each held for `1 / rate_Hz`, the last one for ever."""

    levels_V: Sequence[float]
    rate_Hz: float
    start_s: float

    def passed(self, now_s: float) -> int:
        """Return how many levels have begun."""
        return max(0, min(len(self.levels_V), math.floor((now_s - self.start_s) * self.rate_Hz) + 1))

    def begins_s(self, place: int) -> float:
        """Return when a level begins."""
        return self.start_s + place / self.rate_Hz


def refused(levels_V: Any, rate_Hz: Any, limits: GuardSettings) -> Trip | None:
    """Return why these levels may not be played from 0 V on, None where they may."""
    if not _is_number(rate_Hz) or not 0.0 < rate_Hz <= _HIGHEST_HZ:
        return Trip("bad_command", f"the controller wanted {rate_Hz!r:.40} levels per second")
    if not isinstance(levels_V, list) or not 0 < len(levels_V) <= MOST_LEVELS or not all(map(_is_number, levels_V)):
        return Trip("bad_command", f"the controller wanted to play {levels_V!r:.80}")
    for place, level_V in enumerate(levels_V):
        if not limits.minimum_V <= level_V <= limits.maximum_V:
            allowed = f"{limits.minimum_V:g} ... {limits.maximum_V:g} V"
            return Trip("profile", f"at {place / rate_Hz:.6g} s the profile is at {level_V:g} V, allowed: {allowed}")
    place = _too_fast(levels_V, rate_Hz, limits)
    if place is not None:
        before_V = levels_V[place - 1] if place else 0.0
        return Trip(
            "profile",
            f"at {place / rate_Hz:.6g} s the profile goes from {before_V:g} to {levels_V[place]:g} V, allowed: "
            f"{limits.slew_V_per_s:g} V/s, {limits.slew_V_per_s * limits.burst_s:g} V at once",
        )
    return None


def _too_fast(levels_V: Sequence[float], rate_Hz: float, limits: GuardSettings) -> int | None:
    """Return the first level that the slew limit would have held back."""
    slew, before_V = SlewLimit(limits.slew_V_per_s, limits.burst_s, 0.0), 0.0
    for place, level_V in enumerate(levels_V):
        if abs(slew.allowed(before_V, level_V, place / rate_Hz) - level_V) > _CLOSE_V:
            return place
        slew.take(level_V - before_V)
        before_V = level_V
    return None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
