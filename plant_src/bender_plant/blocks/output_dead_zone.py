"""A dead zone of the output: what is passed on stands still while a gap is crossed, and follows on either side.

    y -> y - (c + w / 2) above the gap,    y - (c - w / 2) below it,    0 inside;    less its value at rest

A hole that is wider than its pin, in series with a spring; the overlap of a valve, behind its spool. Unlike backlash it
has no memory: the gap lies where it lies, whichever way it is crossed. c is the middle of the gap, from rest; w = 0 is
none. Contacts of rubber, pads and rough faces take over gradually, over some s: s ln(1 + exp(x / s)) for max(x, 0).
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.contact import contact
from bender_plant.parabola import first_crossing
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "output_dead_zone"
STAGE = "structure"
TITLE = "Dead zone of the output"
MEMORY = False


@dataclass(frozen=True, slots=True)
class Parameters:
    """The width of the gap, and where it lies."""

    width_um: float = parameter(0.0, unit="um", low=0.0, text="w, width of the gap, 0 for none", tunable=True)
    centre_um: float = parameter(0.0, unit="um", text="c, middle of the gap, from rest", tunable=True)
    rounding_um: float = parameter(
        0.0, unit="um", low=0.0, text="s, way over which the contacts take over, 0 for at once", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def beyond(y: float, low: float, high: float, s: float) -> float:
    """Return what the contacts above and below the gap pass on of y, with its sign."""
    return contact(y - high, s) - contact(low - y, s)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return the edges of the gap, s, and what is passed on at rest, in um."""
    del beam
    low = settings.centre_um - 0.5 * settings.width_um
    high = settings.centre_um + 0.5 * settings.width_um
    s = settings.rounding_um
    return low, high, s, beyond(0.0, low, high, s)


def corner(state: tuple[float, ...], constants: tuple[float, ...], h: float, y0: float, ym: float, y1: float) -> float:
    """Return the fraction of the sub-step at which the gap is entered or left, 1 for none."""
    del state, h
    low, high, _, _ = constants
    if low == high:
        return 1.0
    return min(first_crossing(y0, ym, y1, low), first_crossing(y0, ym, y1, high))


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, y0: float, ym: float, y1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Take the gap out."""
    del time_s, h
    low, high, s, rest = constants
    start, middle, end = beyond(y0, low, high, s), beyond(ym, low, high, s), beyond(y1, low, high, s)
    return state, start - rest, middle - rest, end - rest
