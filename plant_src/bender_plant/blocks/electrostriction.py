"""Electrostriction: a displacement with the square of the voltage, w -> w + c v^2.

Instantaneous and even: the same on both branches, a shift of the mean and a second harmonic. The Maxwell stress at
50 V on 28 um is 0.1 % of the piezoelectric strain; the electrostriction of PVDF itself reaches a few per cent.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "electrostriction"
STAGE = "material"
TITLE = "Electrostriction"
BESIDE = "voltage"


@dataclass(frozen=True, slots=True)
class Parameters:
    """The quadratic coefficient."""

    coefficient_um_per_V2: float = parameter(
        0.0, unit="um/V2", low=-1e6, high=1e6, text="c, displacement per squared voltage", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (c,) in um/V^2."""
    del beam
    return (settings.coefficient_um_per_V2,)


def beside(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float,
    w0: float, wm: float, w1: float, v0: float, vm: float, v1: float,
) -> tuple[tuple[float, ...], float, float, float]:  # fmt: skip
    """Add c v^2."""
    del time_s, h
    c = constants[0]
    return state, w0 + c * v0 * v0, wm + c * vm * vm, w1 + c * v1 * v1
