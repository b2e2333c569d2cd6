"""A periodic disturbance: one sine is added, y -> y + a sin(2 pi f t) + b cos(2 pi f t), t from t = 0.

Mains hum, a fan, a vibration of the table. Above half the frame rate it appears at its alias: 60 Hz in a camera of
29.97 frames per second is a slow swing of 0.06 Hz.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "periodic_disturbance"
STAGE = "surroundings"
TITLE = "Periodic disturbance"


@dataclass(frozen=True, slots=True)
class Parameters:
    """Two amplitudes and the frequency."""

    sine_um: float = parameter(0.0, unit="um", text="a, amplitude of the sine", tunable=True)
    cosine_um: float = parameter(0.0, unit="um", text="b, amplitude of the cosine", tunable=True)
    frequency_Hz: float = parameter(
        50.0, unit="Hz", low=1e-6, high=1e6, text="f, frequency of the disturbance", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (a, b, angular frequency in rad/s)."""
    del beam
    return settings.sine_um, settings.cosine_um, 2.0 * math.pi * settings.frequency_Hz


def ringing_step_s(settings: Parameters, beam: "CompositeBeam | None") -> float:
    """Return the longest sub-step over which the sine passes for a parabola."""
    del beam
    silent = settings.sine_um == 0.0 == settings.cosine_um
    return math.inf if silent else 0.2 / (2.0 * math.pi * settings.frequency_Hz)


def swing(time_s: float, a: float, b: float, omega: float) -> float:
    """Return the disturbance at a time."""
    return a * math.sin(omega * time_s) + b * math.cos(omega * time_s)


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, y0: float, ym: float, y1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Add the sine."""
    a, b, omega = constants
    middle, end = time_s + 0.5 * h, time_s + h
    return state, y0 + swing(time_s, a, b, omega), ym + swing(middle, a, b, omega), y1 + swing(end, a, b, omega)
