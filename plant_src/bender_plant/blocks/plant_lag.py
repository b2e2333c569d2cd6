"""The lags of a plant that has no beam, tau_1 w1' = w - w1 and tau_2 w2' = w1 - w2.

A first-order plant, or one of two real poles, in the place where an actuator of this project has its modes: what acts
on the input comes before it, what acts on the output behind it. A parabola over the sub-step is answered exactly;
tau = 0 is no lag.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.first_order_lag import two_lags_step
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "plant_lag"
STAGE = "structure"
TITLE = "Lags of the plant"
MEMORY = True


@dataclass(frozen=True, slots=True)
class Parameters:
    """Neutral with no time constant."""

    time_constant_s: float = parameter(
        0.0, unit="s", low=0.0, high=1e6, text="first time constant, 0 for none", tunable=True
    )
    second_time_constant_s: float = parameter(
        0.0, unit="s", low=0.0, high=1e6, text="second time constant, 0 for none", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (tau_1, tau_2) in s."""
    del beam
    return (settings.time_constant_s, settings.second_time_constant_s)


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (w1, w2) at rest."""
    del constants
    return (0.0, 0.0)


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the first sub-step after a jump, short enough for the exponentials to pass for parabolas."""
    del beam
    first, second = settings.time_constant_s, settings.second_time_constant_s
    return min(0.05 * first if first > 0.0 else math.inf, 0.05 * second if second > 0.0 else math.inf), math.inf


def step(
    state: tuple[float, ...],
    constants: tuple[float, ...],
    time_s: float,
    h: float,
    w0: float,
    wm: float,
    w1: float,
) -> tuple[tuple[float, ...], float, float, float]:
    """Advance both lags over one sub-step."""
    del time_s
    first, second, start, middle, end = two_lags_step(state[0], state[1], constants[0], constants[1], h, w0, wm, w1)
    return (first, second), start, middle, end
