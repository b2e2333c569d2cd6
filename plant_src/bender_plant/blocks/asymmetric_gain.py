"""A gain that differs with the sign: v -> v for v >= 0, (1 + a) v for v < 0.

A hydraulic cylinder with a rod on one side, a push-pull stage whose halves differ, a pump that works both ways. a = 0
is no difference.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parabola import first_crossing
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "asymmetric_gain"
STAGE = "supply"
TITLE = "Asymmetric gain"


@dataclass(frozen=True, slots=True)
class Parameters:
    """By how much the gain of negative commands differs."""

    difference: float = parameter(
        0.0, unit="1", low=-1.0, high=100.0, text="a, further gain of negative commands", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (a,)."""
    del beam
    return (settings.difference,)


def corner(state: tuple[float, ...], constants: tuple[float, ...], h: float, u0: float, um: float, u1: float) -> float:
    """Return the fraction of the sub-step at which the voltage changes its sign, 1 for none."""
    del state, h
    if constants[0] == 0.0 or u0 == um == u1:
        return 1.0
    return first_crossing(u0, um, u1, 0.0)


def by_sign(u: float, a: float) -> float:
    """Return the voltage with the gain of its sign."""
    return u if u >= 0.0 else (1.0 + a) * u


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, u0: float, um: float, u1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Give each sign its gain."""
    del time_s, h
    a = constants[0]
    return state, by_sign(u0, a), by_sign(um, a), by_sign(u1, a)
