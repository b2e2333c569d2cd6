"""A static curve of the output: the reading bends, r -> r + c_2 r^2 + ... + c_5 r^5.

A load cell, a thermocouple, a resistive sensor, a flow meter: what a sensor gives is a curve of what it measures, the
same at any speed and on the way up and down. r is measured from the reading at rest; the slope there is the gain.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.curve import bent
from bender_plant.parameter import check, check_straight, curve_end, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "output_curve"
STAGE = "sensor"
TITLE = "Curved reading"
MEMORY = False


@dataclass(frozen=True, slots=True)
class Parameters:
    """Neutral at zero."""

    quadratic_1_per_um: float = parameter(0.0, unit="1/um", text="c_2, curvature at rest", tunable=True)
    cubic_1_per_um2: float = parameter(0.0, unit="1/um2", text="c_3, odd part of the curve", tunable=True)

    quartic_1_per_um3: float = parameter(0.0, unit="1/um3", text="c_4, fourth power in the curve", tunable=True)
    quintic_1_per_um4: float = parameter(0.0, unit="1/um4", text="c_5, fifth power in the curve", tunable=True)
    straight_below_um: float = curve_end(-1e12, "lowest", "um")
    straight_above_um: float = curve_end(1e12, "highest", "um")

    def __post_init__(self) -> None:
        check(self, ID)
        check_straight(ID, self.straight_below_um, self.straight_above_um, "um")


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (c_2, c_3, c_4, c_5), and the levels beyond which the curve runs straight."""
    del beam
    return (
        settings.quadratic_1_per_um,
        settings.cubic_1_per_um2,
        settings.quartic_1_per_um3,
        settings.quintic_1_per_um4,
        settings.straight_below_um,
        settings.straight_above_um,
    )


def step(
    state: tuple[float, ...],
    constants: tuple[float, ...],
    time_s: float,
    h: float,
    r0: float,
    rm: float,
    r1: float,
) -> tuple[tuple[float, ...], float, float, float]:
    """Bend the reading."""
    del time_s, h
    c2, c3, c4, c5, low, high = constants
    start = bent(r0, c2, c3, c4, c5, low, high)
    middle = bent(rm, c2, c3, c4, c5, low, high)
    return state, start, middle, bent(r1, c2, c3, c4, c5, low, high)
