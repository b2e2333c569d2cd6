"""A supply whose output moves no faster than its slew rate, both ways: |dv/dt| <= S.

High-voltage amplifiers are bounded by their current into the load, S = I / C: 1 mA into 1 uF is 1 000 V/s. Towards a
held command the output runs along a straight line with a corner where it arrives.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parabola import INSTANT, first_crossing
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "slew_limit"
STAGE = "supply"
TITLE = "Slew limit of the supply"
MEMORY = True
CAUGHT_V = 1e-9
ALMOST = 1.0 + 1e-9


@dataclass(frozen=True, slots=True)
class Parameters:
    """The slew rate."""

    slew_rate_V_per_s: float = parameter(
        100000.0, unit="V/s", low=1e-30, text="largest rate of the output voltage", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (S,) in V/s."""
    del beam
    return (settings.slew_rate_V_per_s,)


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (v,) at rest."""
    del constants
    return (0.0,)


def _behind(v: float, rate: float, h: float, u0: float) -> bool:
    """Return whether the output has to run: the command is further away than it gets in an instant of h."""
    return abs(u0 - v) > CAUGHT_V and abs(u0 - v) > INSTANT * rate * h


def _run(v: float, rate: float, h: float, u0: float, u1: float) -> float:
    """Return the signed change over h while the output runs at its limit, 0 where it follows a straight command."""
    if _behind(v, rate, h, u0):
        return math.copysign(rate * h, u0 - v)
    return math.copysign(rate * h, u1 - u0) if abs(u1 - u0) > rate * h * ALMOST else 0.0


def corner(state: tuple[float, ...], constants: tuple[float, ...], h: float, u0: float, um: float, u1: float) -> float:
    """Return the fraction of the sub-step at which the output catches up with the command, 1 for none."""
    v = state[0]
    run = _run(v, constants[0], h, u0, u1)
    if run == 0.0 or not _behind(v, constants[0], h, u0):
        return 1.0
    return first_crossing(u0 - v, um - v - 0.5 * run, u1 - v - run, 0.0)


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, u0: float, um: float, u1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Follow the command as fast as the limit allows."""
    del time_s
    v = state[0]
    run = _run(v, constants[0], h, u0, u1)
    if run == 0.0:
        return (u1,), u0, um, u1
    middle, end = v + 0.5 * run, v + run
    if _behind(v, constants[0], h, u0) and (u1 - end) * run <= abs(run) * CAUGHT_V:
        end = u1
    return (end,), v, middle, end
