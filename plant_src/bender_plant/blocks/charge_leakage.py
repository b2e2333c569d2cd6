"""Charge that leaks away under a held voltage: v -> v - f LP(v), LP a low-pass of time constant tau.

The film is a capacitor with a leak, and the effective field under a held voltage sags by the fraction f. For clean
PVDF tau = rho eps is above 1 000 s; moisture, a coaxial cable or a charge amplifier bring it to seconds. f = 0 is
no leakage.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.first_order_lag import lag_step
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "charge_leakage"
STAGE = "material"
TITLE = "Charge leakage"
MEMORY = True


@dataclass(frozen=True, slots=True)
class Parameters:
    """How much leaks and how fast."""

    fraction: float = parameter(
        0.0, unit="1", low=-1.0, high=1.0, text="part of a held voltage that is lost in the end", tunable=True
    )
    time_constant_s: float = parameter(
        10.0, unit="s", low=1e-6, high=1e6, text="time constant of the loss", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (f, tau)."""
    del beam
    return settings.fraction, settings.time_constant_s


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (LP,) at rest."""
    del constants
    return (0.0,)


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the first sub-step after a jump, short enough for the exponential to pass for a parabola."""
    del beam
    return (0.05 * settings.time_constant_s if settings.fraction else math.inf), math.inf


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, u0: float, um: float, u1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Take the leaked part off."""
    del time_s
    f, tau = constants
    middle, end = lag_step(state[0], tau, h, u0, um, u1)
    return (end,), u0 - f * state[0], um - f * middle, u1 - f * end
