"""A limit of the output, one-sided: beyond a level it follows less, or not at all.

    side = "above"   y -> y - (1 - s) max(y - l, 0)          l above rest
    side = "below"   y -> y + (1 - s) max(-l - y, 0)         l below rest

A diode, an overflow, a stop, a spool at the end of its travel: between two linear parts (`plant_lag` or the modes
before it, `sensor_lag` behind it) or at the very end. s is the slope that remains beyond the level, 0 for a hard limit.
The turn is a corner, or gradual over some b: b ln(1 + exp(x / b)) for max(x, 0), as a diode behind a resistor turns.
A limit far away is none.

Behind a limit of the reading things go on, and have to come back first. A stop holds what moves, so that it comes off
as soon as the drive turns: a throttle at its stop, a tank at its brim, a force that yields. With tau > 0 the limit is
one, of a lag of its own, and may have another one on the other side, l_2:

    tau y' = w - y  between the stops;    y = l for as long as w >= l;    y = -l_2 for as long as w <= -l_2
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.contact import contact
from bender_plant.kernels.stop import held_at, reached, stopped
from bender_plant.parabola import first_crossing
from bender_plant.parameter import ModelError, check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "output_limit"
STAGE = "structure"
TITLE = "Limit of the output"
MEMORY = True
FORMS = ("above", "below")
FAR_um = 1e9


@dataclass(frozen=True, slots=True)
class Parameters:
    """The side, the level, and what remains beyond it."""

    form: str = "above"
    level_um: float = parameter(
        FAR_um, unit="um", low=0.0, high=FAR_um, text="l, distance of the level from rest", tunable=True
    )
    remaining_slope: float = parameter(
        0.0, unit="1", low=0.0, high=1.0, text="s, slope beyond the level, 0 for a hard limit", tunable=True
    )
    rounding_um: float = parameter(
        0.0, unit="um", low=0.0, high=FAR_um, text="b, way over which it turns, 0 for a corner", tunable=True
    )
    time_constant_s: float = parameter(
        0.0, unit="s", low=0.0, high=1e6, text="tau, of what a stop holds, 0 for a limit of the reading", tunable=True
    )
    other_level_um: float = parameter(
        FAR_um, unit="um", low=0.0, high=FAR_um, text="l_2, of a stop on the other side", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)
        if self.form not in FORMS:
            raise ModelError(f"{ID}.form: found {self.form!r}, expected one of {FORMS}")


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (direction, l in um, lost slope, b in um, what is lost at rest in um, tau in s, highest, lowest in um)."""
    del beam
    direction = 1.0 if settings.form == "above" else -1.0
    level, lost, b = settings.level_um, 1.0 - settings.remaining_slope, settings.rounding_um
    sides = (level, settings.other_level_um) if settings.form == "above" else (settings.other_level_um, level)
    return direction, level, lost, b, lost * contact(-level, b), settings.time_constant_s, *sides


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (y,) at rest, of what a stop holds."""
    del constants
    return (0.0,)


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the first sub-step after a jump, and the longest: what comes to a stop bends without a jump."""
    del beam
    tau = settings.time_constant_s
    return (0.05 * tau, 0.1 * tau) if tau > 0.0 else (math.inf, math.inf)


def limited(y: float, direction: float, level: float, lost: float, b: float, rest: float) -> float:
    """Return what passes of y."""
    return y - direction * (lost * contact(direction * y - level, b) - rest)


def corner(state: tuple[float, ...], constants: tuple[float, ...], h: float, y0: float, ym: float, y1: float) -> float:
    """Return the fraction of the sub-step at which the level is passed, or a stop reached or left; 1 for none."""
    direction, level, lost, b, _, tau, high, low = constants
    if tau == 0.0:
        return 1.0 if lost == 0.0 or b > 0.0 else first_crossing(y0, ym, y1, direction * level)
    held = held_at(state[0], high, low)
    if held != 0.0:
        stop = high if held > 0.0 else -low
        left = first_crossing(y0, ym, y1, stop)
        if left < 1.0 or held * ym >= held * stop:
            return left
    return min(reached(state[0], tau, high, h, y0, ym, y1), reached(state[0], tau, -low, h, y0, ym, y1))


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, y0: float, ym: float, y1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Hold the output back beyond the level, or what moves at its stops."""
    del time_s
    direction, level, lost, b, rest, tau, high, low = constants
    if tau > 0.0:
        start, middle, end = stopped(state[0], tau, high, low, h, y0, ym, y1)
        return (end,), start, middle, end
    start = limited(y0, direction, level, lost, b, rest)
    middle = limited(ym, direction, level, lost, b, rest)
    end = limited(y1, direction, level, lost, b, rest)
    return (end,), start, middle, end
