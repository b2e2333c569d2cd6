"""Creep: slow copies of the displacement follow it, w -> w + sum_k g_k x_k with tau_k x_k' = w - x_k.

Equal gains on time constants that grow by a constant factor make the displacement grow with the logarithm of time,
g = gamma log10(factor) for a growth of gamma per decade (Jung and Gweon, Review of Scientific Instruments 71, 2000):
1 % to 2 % per decade in ceramics, more in polymers. A few single relaxations are viscoelasticity (Kelvin-Voigt).
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.first_order_lag import lag_step
from bender_plant.kernels.state import of_any_length
from bender_plant.parameter import ModelError, check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "creep"
STAGE = "material"
TITLE = "Creep"
MEMORY = True
STATE_OF_ANY_LENGTH = True

_Constants = tuple[tuple[float, ...], tuple[float, ...]]


@dataclass(frozen=True, slots=True)
class Parameters:
    """Gain and time constant of every slow copy."""

    gains: tuple[float, ...] = parameter(
        (), unit="1", low=-10.0, high=10.0, text="g_k, size of each slow copy", tunable=True
    )
    time_constants_s: tuple[float, ...] = parameter(
        (), unit="s", low=1e-9, high=1e6, text="tau_k, time constant of each slow copy", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)
        if len(self.gains) != len(self.time_constants_s):
            found = f"{len(self.gains)} gains and {len(self.time_constants_s)} time constants"
            raise ModelError(f"{ID}.gains: found {found}, expected the same number of each")


def constants(settings: Parameters, beam: "CompositeBeam | None") -> _Constants:
    """Return (all g_k, all tau_k)."""
    del beam
    return settings.gains, settings.time_constants_s


def initial(constants: _Constants) -> tuple[float, ...]:
    """Return the slow copies at rest."""
    return (0.0,) * len(constants[0])


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the first sub-step after a jump, short enough for the exponentials to pass for parabolas."""
    del beam
    return 0.05 * min(settings.time_constants_s, default=math.inf), math.inf


def step(
    state: tuple[float, ...], constants: _Constants, time_s: float, h: float, w0: float, wm: float, w1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Add the slow copies."""
    del time_s
    y0, ym, y1 = w0, wm, w1
    after: list[float] = []
    gains, taus = constants
    for k in range(len(gains)):
        x, g = state[k], gains[k]
        middle, end = lag_step(x, taus[k], h, w0, wm, w1)
        after.append(end)
        y0 += g * x
        ym += g * middle
        y1 += g * end
    return of_any_length(after), y0, ym, y1
