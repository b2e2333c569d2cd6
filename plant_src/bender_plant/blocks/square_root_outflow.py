"""Outflow with the square root of the level, a lag that drains by Torricelli's law, into a second one or not.

    tau y' = w - g(y, H),    tau_2 z' = g(y, H) - g(z, H_2),    g(y, H) = 2 H (sqrt(1 + y / H) - 1)

A tank with a hole, a boiler that blows off, a volume behind an orifice. y is the level above that at rest, H the head
over the outlet there: near rest a lag of time constant tau, slower than that above it and quicker below. A head far
above the range is a plain lag; tau = 0 is none. z is read where there is a second tank. (Torricelli 1643; Schoukens and
others, Cascaded tanks benchmark, Nonlinear System Identification Benchmarks 2016.)
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.draining_lag import TANK, losing_step, loss
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "square_root_outflow"
STAGE = "structure"
TITLE = "Square-root outflow"
MEMORY = True
FAR_um = 1e9


@dataclass(frozen=True, slots=True)
class Parameters:
    """Neutral with no time constant."""

    time_constant_s: float = parameter(
        0.0, unit="s", low=0.0, high=1e6, text="tau, time constant near rest, 0 for none", tunable=True
    )
    head_um: float = parameter(
        FAR_um, unit="um", low=1e-30, high=FAR_um, text="H, head over the outlet at rest", tunable=True
    )
    second_time_constant_s: float = parameter(
        0.0, unit="s", low=0.0, high=1e6, text="tau_2, of a tank below near rest, 0 for none", tunable=True
    )
    second_head_um: float = parameter(
        FAR_um, unit="um", low=1e-30, high=FAR_um, text="H_2, head over the outlet of the tank below", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (tau in s, H in um, tau_2 in s, H_2 in um)."""
    del beam
    return settings.time_constant_s, settings.head_um, settings.second_time_constant_s, settings.second_head_um


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (y, z) at rest."""
    del constants
    return (0.0, 0.0)


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the first sub-step after a jump, and the longest of an equation that is integrated step by step."""
    del beam
    first, second = settings.time_constant_s, settings.second_time_constant_s
    tau = min(first if first > 0.0 else math.inf, second if second > 0.0 else math.inf)
    return 0.02 * tau, 0.05 * tau


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, w0: float, wm: float, w1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Fill and drain over one sub-step."""
    del time_s
    tau, head, second_tau, second_head = constants
    level, lower = state[0], state[1]
    y0, ym, y1 = w0, wm, w1
    if tau > 0.0:
        y0 = level
        ym, y1 = losing_step(level, tau, head, TANK, h, w0, wm, w1)
        level = y1
    if second_tau > 0.0:
        q0, qm, q1 = y0, ym, y1
        if tau > 0.0:
            q0, qm, q1 = loss(y0, head, TANK), loss(ym, head, TANK), loss(y1, head, TANK)
        y0 = lower
        ym, y1 = losing_step(lower, second_tau, second_head, TANK, h, q0, qm, q1)
        lower = y1
    return (level, lower), y0, ym, y1
