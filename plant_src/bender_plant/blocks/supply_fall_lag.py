"""A one-quadrant supply: it drives its output up, but only a bleeder takes it down, tau v' = v_c - v while v_c < v.

Laboratory supplies fall in 0.1 s to 1 s without load. Rising, the output is the command. tau = 0 is no lag.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.first_order_lag import lag_step
from bender_plant.parabola import first_crossing, turning_point
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "supply_fall_lag"
STAGE = "supply"
TITLE = "Slow fall of the supply"
MEMORY = True


@dataclass(frozen=True, slots=True)
class Parameters:
    """The time constant of the fall."""

    time_constant_s: float = parameter(
        0.0, unit="s", low=0.0, high=1e6, text="time constant of the fall, 0 for none", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (tau,) in s."""
    del beam
    return (settings.time_constant_s,)


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (v,) at rest."""
    del constants
    return (0.0,)


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the first sub-step after a jump, short enough for the exponential to pass for a parabola."""
    del beam
    tau = settings.time_constant_s
    return (0.05 * tau if tau > 0.0 else math.inf), math.inf


def corner(state: tuple[float, ...], constants: tuple[float, ...], h: float, u0: float, um: float, u1: float) -> float:
    """Return the fraction of the sub-step at which the output meets the command or the command turns, 1 for none."""
    tau = constants[0]
    if tau <= 0.0 or u0 == um == u1:
        return 1.0
    turn = turning_point(u0, um, u1)
    v = state[0]
    if v <= u0 or turn < 1.0:
        return turn
    middle, end = lag_step(v, tau, h, u0, um, u1)
    return first_crossing(u0 - v, um - middle, u1 - end, 0.0)


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, u0: float, um: float, u1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Follow the command upwards, lag behind it downwards."""
    del time_s
    tau = constants[0]
    v = state[0]
    if tau <= 0.0 or (v <= u0 and u1 >= u0):
        return (u1,), u0, um, u1
    v = max(v, u0)
    middle, end = lag_step(v, tau, h, u0, um, u1)
    middle, end = max(middle, um), max(end, u1)
    return (end,), v, middle, end
