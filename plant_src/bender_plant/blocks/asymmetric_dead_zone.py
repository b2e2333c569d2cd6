"""A dead zone that is wider on one side: v -> v - v_p above v_p, v + v_n below -v_n, nothing between.

A spool valve whose lands overlap unequally, a motor whose friction or current differs with the direction. Equal
thresholds are `dead_zone`; v_p = v_n = 0 is none.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parabola import first_crossing
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "asymmetric_dead_zone"
STAGE = "supply"
TITLE = "Asymmetric dead zone"


@dataclass(frozen=True, slots=True)
class Parameters:
    """The thresholds of both signs."""

    positive_V: float = parameter(0.0, unit="V", low=0.0, text="v_p, threshold of positive commands", tunable=True)
    negative_V: float = parameter(
        0.0, unit="V", low=0.0, text="v_n, size of the threshold of negative commands", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (v_p, v_n) in V."""
    del beam
    return settings.positive_V, settings.negative_V


def corner(state: tuple[float, ...], constants: tuple[float, ...], h: float, u0: float, um: float, u1: float) -> float:
    """Return the fraction of the sub-step at which the voltage enters or leaves the dead zone, 1 for none."""
    del state, h
    if u0 == um == u1:
        return 1.0
    return min(first_crossing(u0, um, u1, constants[0]), first_crossing(u0, um, u1, -constants[1]))


def outside(u: float, above: float, below: float) -> float:
    """Return how far the voltage lies above the one threshold or below the other, with its sign."""
    return u - above if u > above else u + below if u < -below else 0.0


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, u0: float, um: float, u1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Cut out the dead zone."""
    del time_s, h
    above, below = constants
    return state, outside(u0, above, below), outside(um, above, below), outside(u1, above, below)
