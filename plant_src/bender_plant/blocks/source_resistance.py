"""A first-order supply: source resistance and the capacitance behind it, tau v' = v_c - v.

With 0.88 nF a megohm gives 0.9 ms; a laboratory supply that follows its set-point in 20 ms is the same equation. A
parabola of v_c over the sub-step is answered exactly; tau = 0 is no supply lag.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.first_order_lag import lag_step
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "source_resistance"
STAGE = "supply"
TITLE = "Source resistance"
MEMORY = True


@dataclass(frozen=True, slots=True)
class Parameters:
    """The lag of the electrode voltage behind the command."""

    time_constant_s: float = parameter(
        0.0, unit="s", low=0.0, high=100.0, text="resistance times capacitance, 0 for none", tunable=True
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


def step(
    state: tuple[float, ...],
    constants: tuple[float, ...],
    time_s: float,
    h: float,
    u0: float,
    um: float,
    u1: float,
) -> tuple[tuple[float, ...], float, float, float]:
    """Advance the electrode voltage over one sub-step."""
    del time_s
    tau = constants[0]
    if tau <= 0.0:
        return (u1,), u0, um, u1
    middle, end = lag_step(state[0], tau, h, u0, um, u1)
    return (end,), state[0], middle, end
