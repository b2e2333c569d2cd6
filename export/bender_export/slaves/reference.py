"""The reference as an FMI slave: a setpoint that climbs a staircase, or makes a single step.

    r(t) = initial                                      for t <= start
    r(t) = initial + rise * (1 + floor((t - start) / dwell))    afterwards, up to final

With rise = 0 there is one step from initial to final; a final below initial is climbed down.
"""

# The builder copies this file under a content-hashed name and renames the modules that it imports likewise.

import math
from typing import Any

from bender_export.slaves.shell import Row, Shell

IDENTITY = "StaircaseReference"

TABLE = (
    Row("setpoint", "output", "discrete", "m", 0.0, -math.inf, math.inf, "displacement that is asked for"),
    Row("staircase.initial", "parameter", "tunable", "m", 0.0, -1.0, 1.0, "setpoint before the first stair"),
    Row("staircase.final", "parameter", "tunable", "m", 1e-5, -1.0, 1.0, "setpoint after the last stair"),
    Row("staircase.rise", "parameter", "tunable", "m", 0.0, 0.0, 1.0, "height of a stair, 0 for one single step"),
    Row("staircase.start", "parameter", "tunable", "s", 0.0, -1e9, 1e9, "when the first stair begins"),
    Row("staircase.dwell", "parameter", "tunable", "s", 0.5, 1e-6, 1e9, "time from stair to stair"),
)
# hosts add up their steps: a stair begins where it is meant to although the time is off by some rounding
_ROUNDING_S = 1e-9


class StaircaseReference(Shell):
    """A staircase over FMI: nothing in, metres out."""

    IDENTITY = IDENTITY

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(TABLE, **kwargs)
        self.rest()

    def rest(self) -> None:
        """Show the setpoint of the start time."""
        self.values[0] = self.setpoint_m(self.start_time_s)

    def step(self, current_time: float, step_size: float) -> None:
        """Show the setpoint of the end of the step."""
        if not 0.0 < step_size < math.inf:
            raise ValueError(f"found a step of {step_size!r} s, expected more than 0")
        self.values[0] = self.setpoint_m(current_time + step_size)

    def setpoint_m(self, time_s: float) -> float:
        """Return the setpoint at a time."""
        _, initial, final, rise, start, dwell = self.values
        since = time_s - start - _ROUNDING_S
        if since <= 0.0:
            return initial
        stairs = 1.0 + math.floor(since / dwell)
        climbed = rise * stairs
        if rise == 0.0 or climbed >= abs(final - initial):
            return final
        return initial + math.copysign(climbed, final - initial)
