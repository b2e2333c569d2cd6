"""End stops: what moves rests at a stop, and comes off it at once when the drive turns.

    tau y' = w - y  between the stops;    y = h for as long as w >= h,    y = -l for as long as w <= -l

A throttle at its stops, a tank at its brim, a slide at the end of its travel: the stop takes up what the drive has too
much of, so that nothing winds up. (A limit of the reading, `output_limit`, ends only when what is behind it has come
back.) h and l are the ways from rest to the upper and the lower stop; tau = 0 is none.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.first_order_lag import lag_step
from bender_plant.parabola import INSTANT, first_crossing, value
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "end_stop"
STAGE = "structure"
TITLE = "End stop"
MEMORY = True
FAR_um = 1e9
ROUNDING = 1e-9
"""Of a stop: what ended there did so within rounding."""
TURNS = 2


@dataclass(frozen=True, slots=True)
class Parameters:
    """Neutral with no time constant."""

    time_constant_s: float = parameter(
        0.0, unit="s", low=0.0, high=1e6, text="tau, between the stops, 0 for none", tunable=True
    )
    highest_um: float = parameter(
        FAR_um, unit="um", low=0.0, high=FAR_um, text="h, way from rest to the upper stop", tunable=True
    )
    lowest_um: float = parameter(
        FAR_um, unit="um", low=0.0, high=FAR_um, text="l, way from rest to the lower stop", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (tau in s, h in um, l in um)."""
    del beam
    return settings.time_constant_s, settings.highest_um, settings.lowest_um


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (y,) at rest."""
    del constants
    return (0.0,)


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the first sub-step after a jump, and the longest: what comes to a stop bends without a jump."""
    del beam
    tau = settings.time_constant_s
    return (0.05 * tau, 0.1 * tau) if tau > 0.0 else (math.inf, math.inf)


def held_at(y: float, wm: float, high: float, low: float) -> float:
    """Return 1 at the upper stop and -1 at the lower one, over a sub-step in which none is reached or left; else 0."""
    if y >= high * (1.0 - ROUNDING) and wm >= high:
        return 1.0
    return -1.0 if y <= -low * (1.0 - ROUNDING) and wm <= -low else 0.0


def reached(y: float, tau: float, stop: float, h: float, w0: float, wm: float, w1: float) -> float:
    """Return the fraction of the sub-step at which a stop is reached, 1 for none: by a parabola, then by Newton."""
    middle, end = lag_step(y, tau, h, w0, wm, w1)
    at = first_crossing(y, middle, end, stop)
    if at == 1.0:
        return at
    for _ in range(TURNS):
        here = value(w0, wm, w1, at)
        _, y_at = lag_step(y, tau, at * h, w0, value(w0, wm, w1, 0.5 * at), here)
        moves = (here - y_at) * h / tau
        if moves != 0.0:
            at = min(max(at + (stop - y_at) / moves, INSTANT), 1.0 - INSTANT)
    return at


def corner(state: tuple[float, ...], constants: tuple[float, ...], h: float, w0: float, wm: float, w1: float) -> float:
    """Return the fraction of the sub-step at which a stop is reached or left, 1 for none."""
    tau, high, low = constants
    y = state[0]
    if tau == 0.0:
        return 1.0
    if y >= high * (1.0 - ROUNDING):
        left = first_crossing(w0, wm, w1, high)
        if left < 1.0 or wm >= high:
            return left
    if y <= -low * (1.0 - ROUNDING):
        left = first_crossing(w0, wm, w1, -low)
        if left < 1.0 or wm <= -low:
            return left
    return min(reached(y, tau, high, h, w0, wm, w1), reached(y, tau, -low, h, w0, wm, w1))


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, w0: float, wm: float, w1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Follow between the stops, or rest at one."""
    del time_s
    tau, high, low = constants
    if tau == 0.0:
        return (w1,), w0, wm, w1
    y = min(max(state[0], -low), high)
    held = held_at(y, wm, high, low)
    if held != 0.0:
        stop = high if held > 0.0 else -low
        return (stop,), stop, stop, stop
    middle, end = lag_step(y, tau, h, w0, wm, w1)
    middle, end = min(max(middle, -low), high), min(max(end, -low), high)
    return (end,), y, middle, end
