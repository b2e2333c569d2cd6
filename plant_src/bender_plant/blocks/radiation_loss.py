"""A body that loses heat by radiation: a lag whose loss grows with the fourth power of its temperature.

    tau y' = w - g(y, T),    g(y, T) = T / 4 ((1 + y / T)^4 - 1)

A heater, an oven, a lamp, a hot wire. y is the temperature above that at rest, T the absolute temperature there in the
unit of the reading: near rest a lag of time constant tau and gain 1, quicker and with less gain the hotter it is. Heat
that is conducted beside makes T larger. T far above the range is a plain lag; tau = 0 is none. (Stefan 1879, Boltzmann
1884; Incropera and DeWitt, Fundamentals of Heat and Mass Transfer, section 5.3.)
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.draining_lag import RADIATION, losing_step
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "radiation_loss"
STAGE = "structure"
TITLE = "Loss by radiation"
MEMORY = True
FAR_um = 1e9


@dataclass(frozen=True, slots=True)
class Parameters:
    """Neutral with no time constant."""

    time_constant_s: float = parameter(
        0.0, unit="s", low=0.0, high=1e6, text="tau, time constant near rest, 0 for none", tunable=True
    )
    rest_um: float = parameter(
        FAR_um, unit="um", low=1e-30, high=FAR_um, text="T, absolute temperature at rest", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (tau in s, T in um)."""
    del beam
    return settings.time_constant_s, settings.rest_um


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
    """Heat up and cool down over one sub-step."""
    del time_s
    tau, rest = constants
    if tau == 0.0:
        return (w1,), w0, wm, w1
    y = state[0]
    middle, end = losing_step(y, tau, rest, RADIATION, h, w0, wm, w1)
    return (end,), y, middle, end
