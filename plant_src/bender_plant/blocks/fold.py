"""A fold of the reading: the sensor gives the size of what it measures, not its sign.

    r -> r + s (F(r) - r),      F(r) = sqrt((r - c)^2 + b^2) - sqrt(c^2 + b^2)

A pulse counter that cannot tell directions, a rectifier, a power meter, an intensity behind a polariser. s = 1 is the
fold, |r - c| with b = 0; s between 0 and 1 leaves the two sides with slopes 1 and 1 - 2 s. With b far above the range
it is an even curve, a parabola about c. s = 0 is none; r counts from the reading at rest, which stays at 0.
(Wigren and Schoukens, Coupled electric drives data set and reference models, Uppsala University 2017-024.)
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parabola import first_crossing
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "fold"
STAGE = "sensor"
TITLE = "Fold of the reading"
MEMORY = False


@dataclass(frozen=True, slots=True)
class Parameters:
    """How much is folded, and where."""

    share: float = parameter(0.0, unit="1", low=0.0, high=1.0, text="s, 1 for a full fold, 0 for none", tunable=True)
    centre_um: float = parameter(0.0, unit="um", text="c, place of the fold, from rest", tunable=True)
    rounding_um: float = parameter(
        0.0, unit="um", low=0.0, text="b, half-width of the turn, 0 for a corner", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (s, c, b, size at rest), the last three in um."""
    del beam
    c, b = settings.centre_um, settings.rounding_um
    return settings.share, c, b, math.sqrt(c * c + b * b)


def folded(r: float, s: float, c: float, b: float, rest: float) -> float:
    """Return the reading of what lies at r."""
    x = r - c
    size = abs(x) if b == 0.0 else math.sqrt(x * x + b * b)
    return r + s * (size - rest - r)


def corner(state: tuple[float, ...], constants: tuple[float, ...], h: float, r0: float, rm: float, r1: float) -> float:
    """Return the fraction of the sub-step at which the fold is passed, 1 for none."""
    del state, h
    s, c, b, _ = constants
    return 1.0 if s == 0.0 or b > 0.0 else first_crossing(r0, rm, r1, c)


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, r0: float, rm: float, r1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Fold the reading."""
    del time_s, h
    s, c, b, rest = constants
    return state, folded(r0, s, c, b, rest), folded(rm, s, c, b, rest), folded(r1, s, c, b, rest)
