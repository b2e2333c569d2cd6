"""Play between the beam and what is watched: the tip is carried with a play of half-width r.

    x -> max(y - r, min(y + r, x))

A loose wire, a stylus, a gear. After each reversal the first 2 r of the motion are lost. r = 0 is no play.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.play import first_engagement, play
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "backlash"
STAGE = "structure"
TITLE = "Backlash"
MEMORY = True


@dataclass(frozen=True, slots=True)
class Parameters:
    """The half-width of the play."""

    half_width_um: float = parameter(
        0.0, unit="um", low=0.0, text="r, half-width of the play, 0 for none", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (r,) in um."""
    del beam
    return (settings.half_width_um,)


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (x,), in the middle of the play."""
    del constants
    return (0.0,)


def corner(state: tuple[float, ...], constants: tuple[float, ...], h: float, y0: float, ym: float, y1: float) -> float:
    """Return the fraction of the sub-step at which the play engages or the motion turns, 1 for none."""
    del h
    return first_engagement(state, constants, y0, ym, y1)


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, y0: float, ym: float, y1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Carry the tip along."""
    del time_s, h
    r = constants[0]
    start = play(state[0], y0, r)
    middle = play(start, ym, r)
    end = play(middle, y1, r)
    return (end,), start, middle, end
