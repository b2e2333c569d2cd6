"""Drag on something whose speed is read: a lag that a force of the square of the speed holds back.

    tau y' = w - y - d y |y|

A fan, a propeller, a vehicle, a pump, a float. tau and the gain come from inertia and viscous friction, d is the drag
over the viscous one, in one over the unit of the speed. tau = 0 is none; d = 0 is a plain lag. (Newton, Principia,
book II, section 7; Morison and others, Journal of Petroleum Technology 2, 1950, doi:10.2118/950149-G.)
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.draining_lag import DRAG, losing_step
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "speed_drag"
STAGE = "structure"
TITLE = "Drag of a speed"
MEMORY = True


@dataclass(frozen=True, slots=True)
class Parameters:
    """Neutral with no time constant."""

    time_constant_s: float = parameter(
        0.0, unit="s", low=0.0, high=1e6, text="tau, inertia over viscous friction, 0 for none", tunable=True
    )
    drag_1_per_um: float = parameter(
        0.0, unit="1/um", low=0.0, text="d, drag over viscous friction and speed", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (tau in s, d in 1/um)."""
    del beam
    return settings.time_constant_s, settings.drag_1_per_um


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (y,) at rest."""
    del constants
    return (0.0,)


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the first sub-step after a jump, and the longest of an equation that is integrated step by step."""
    del beam
    tau = settings.time_constant_s
    return (0.02 * tau, 0.05 * tau) if tau > 0.0 else (math.inf, math.inf)


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, w0: float, wm: float, w1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Speed up and slow down over one sub-step."""
    del time_s
    tau, drag = constants
    if tau == 0.0:
        return (w1,), w0, wm, w1
    y = state[0]
    middle, end = losing_step(y, tau, drag, DRAG, h, w0, wm, w1)
    return (end,), y, middle, end
