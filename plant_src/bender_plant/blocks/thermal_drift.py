"""Thermal drift: a monotone function of time is added, whatever the voltage, y -> y + d (1 - exp(-(t / tau)^b)).

A bimorph is a thermometer: PVDF on polyimide bends with the temperature of the room, and a bench that warms up does
so with one time constant of minutes. tau far above the record is a straight line.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "thermal_drift"
STAGE = "surroundings"
TITLE = "Thermal drift"


@dataclass(frozen=True, slots=True)
class Parameters:
    """How far it drifts in the end, and how fast."""

    amplitude_um: float = parameter(0.0, unit="um", text="d, displacement in the end", tunable=True)
    time_constant_s: float = parameter(
        100.0, unit="s", low=1e-2, high=1e7, text="tau, time constant of the drift", tunable=True
    )
    exponent: float = parameter(
        1.0, unit="1", low=0.2, high=5.0, text="b, of (t / tau): below 1 many time constants, above 1 a late start"
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (d, tau, b)."""
    del beam
    return settings.amplitude_um, settings.time_constant_s, settings.exponent


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return sub-steps over which the drift passes for a parabola."""
    del beam
    limit = 0.05 * settings.time_constant_s if settings.amplitude_um else math.inf
    return limit, limit


def drift(time_s: float, d: float, tau: float, b: float) -> float:
    """Return the drift since t = 0."""
    return -d * math.expm1(-math.pow(max(time_s, 0.0) / tau, b))


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, y0: float, ym: float, y1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Add the drift."""
    d, tau, b = constants
    middle, end = time_s + 0.5 * h, time_s + h
    return state, y0 + drift(time_s, d, tau, b), ym + drift(middle, d, tau, b), y1 + drift(end, d, tau, b)
