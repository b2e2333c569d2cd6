"""Ageing: the gain fades with time, y -> y (1 - a (1 - exp(-(t / tau)^b))), t from the start of the record.

Depolarisation, a warming film, an adhesive that lets go. tau far above the record is a straight line.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "ageing"
STAGE = "surroundings"
TITLE = "Ageing"


@dataclass(frozen=True, slots=True)
class Parameters:
    """How much is lost in the end, and how fast."""

    loss: float = parameter(
        0.0, unit="1", low=-100.0, high=100.0, text="a, part of the gain that is lost in the end", tunable=True
    )
    time_constant_s: float = parameter(
        100.0, unit="s", low=1e-2, high=1e7, text="tau, time constant of the fading", tunable=True
    )
    exponent: float = parameter(
        1.0, unit="1", low=0.2, high=5.0, text="b, of (t / tau): below 1 many time constants, above 1 a late start"
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (a, tau, b)."""
    del beam
    return settings.loss, settings.time_constant_s, settings.exponent


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return sub-steps over which the fading passes for a parabola."""
    del beam
    limit = 0.05 * settings.time_constant_s if settings.loss else math.inf
    return limit, limit


def faded(y: float, time_s: float, a: float, tau: float, b: float) -> float:
    """Return the displacement with the gain that is left."""
    return y * (1.0 + a * math.expm1(-math.pow(max(time_s, 0.0) / tau, b)))


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, y0: float, ym: float, y1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Let the gain fade."""
    a, tau, b = constants
    middle, end = time_s + 0.5 * h, time_s + h
    return state, faded(y0, time_s, a, tau, b), faded(ym, middle, a, tau, b), faded(y1, end, a, tau, b)
