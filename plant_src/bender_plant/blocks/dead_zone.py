"""Nothing happens below a threshold: v -> sign(v) max(|v| - v0, 0).

An output stage without bias current, or a contact that needs a voltage to close: 0.6 V for a silicon junction.
v0 = 0 is no dead zone.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parabola import first_crossing
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "dead_zone"
STAGE = "supply"
TITLE = "Dead zone"


@dataclass(frozen=True, slots=True)
class Parameters:
    """The threshold."""

    threshold_V: float = parameter(0.0, unit="V", low=0.0, text="half-width of the dead zone", tunable=True)

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (v0,) in V."""
    del beam
    return (settings.threshold_V,)


def corner(state: tuple[float, ...], constants: tuple[float, ...], h: float, u0: float, um: float, u1: float) -> float:
    """Return the fraction of the sub-step at which the voltage enters or leaves the dead zone, 1 for none."""
    del state, h
    v0 = constants[0]
    if v0 <= 0.0 or u0 == um == u1:
        return 1.0
    return min(first_crossing(u0, um, u1, v0), first_crossing(u0, um, u1, -v0))


def beyond(u: float, v0: float) -> float:
    """Return how far the voltage lies beyond the threshold, with its sign."""
    return u - v0 if u > v0 else u + v0 if u < -v0 else 0.0


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, u0: float, um: float, u1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Cut out the dead zone."""
    del time_s, h
    v0 = constants[0]
    return state, beyond(u0, v0), beyond(um, v0), beyond(u1, v0)
