"""Electrostriction: a displacement with the square of the voltage, w -> w + c v^2.

Instantaneous and even: the same on both branches, a shift of the mean and a second harmonic. The Maxwell stress at
50 V on 28 um is 0.1 % of the piezoelectric strain; the electrostriction of PVDF itself reaches a few per cent.

Far from zero it bends, by b:

    b > 0   w + c v^2 / (1 + b v^2)       the square of a polarisation that saturates, v / sqrt(1 + b v^2)
    b < 0   w + c v^2 (1 + |b| v^2)       the next even term: the film gets thinner, the field in it larger

Beyond the voltages that it was learned from it runs on along the line from 0 V through its end.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parameter import check, check_straight, curve_end, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "electrostriction"
STAGE = "material"
TITLE = "Electrostriction"
BESIDE = "voltage"


@dataclass(frozen=True, slots=True)
class Parameters:
    """The quadratic coefficient, and how its parabola bends."""

    coefficient_um_per_V2: float = parameter(
        0.0, unit="um/V2", text="c, displacement per squared voltage", tunable=True
    )
    bending_1_per_V2: float = parameter(
        0.0, unit="1/V2", text="b, flattening (or, below zero, growth) with v^2", tunable=True
    )
    straight_below_V: float = curve_end(-1e12, "lowest")
    straight_above_V: float = curve_end(1e12, "highest")

    def __post_init__(self) -> None:
        check(self, ID)
        check_straight(ID, self.straight_below_V, self.straight_above_V)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return c in um/V^2, the flattening and the growth in 1/V^2, of which one is zero, and where it runs straight."""
    del beam
    b = settings.bending_1_per_V2
    ends = settings.straight_below_V, settings.straight_above_V
    return settings.coefficient_um_per_V2, max(b, 0.0), max(-b, 0.0), *ends


def parabola(v: float, c: float, flattening: float, growth: float, low: float, high: float) -> float:
    """Return the displacement with the square of the voltage, bent, and straight beyond both ends."""
    x = min(max(v, low), high)
    square = x * x
    shrunk = 1.0 + flattening * square
    return v * (c * x * (1.0 + growth * square) / shrunk)


def beside(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float,
    w0: float, wm: float, w1: float, v0: float, vm: float, v1: float,
) -> tuple[tuple[float, ...], float, float, float]:  # fmt: skip
    """Add it to what the voltage gives."""
    del time_s, h
    c, flattening, growth, low, high = constants
    start = parabola(v0, c, flattening, growth, low, high)
    middle = parabola(vm, c, flattening, growth, low, high)
    end = parabola(v1, c, flattening, growth, low, high)
    return state, w0 + start, wm + middle, w1 + end
