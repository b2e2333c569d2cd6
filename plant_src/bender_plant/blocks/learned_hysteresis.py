"""The hysteresis equation that the paper learned by SINDy, equation (30).

    w' = -0.48 w + 1.652 u + 0.818 u' - 0.22 |w| - 0.124 w |w|

with u in V and w in um. On z = w - 0.818 u it needs no derivative of the voltage, and a step of u is just a step:

    z' = -0.48 w + 1.652 u - 0.22 |w| - 0.124 w |w|,    w = z + 0.818 u

It has one equilibrium for each voltage and no remanence: a nonlinear relaxation, not hysteresis in the strict sense
(23.141 um at 50 V, 40.9 um in the first instant).
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parabola import first_crossing
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "learned_hysteresis"
STAGE = "material"
TITLE = "Hysteresis learned by SINDy, equation (30)"
TRANSDUCER = True
MEMORY = True
# the displacement up to which a sub-step is sized, and its part of the time constant there: 0.1 nm after 50 V
STROKE_UM = 25.0
STEP_PART = 0.03


@dataclass(frozen=True, slots=True)
class Parameters:
    """Coefficients of equation (30), by the term that they multiply."""

    displacement_coefficient_1_per_s: float = parameter(
        -0.48, unit="1/s", low=-1e4, high=0.0, text="factor of w: linear relaxation", tunable=True
    )
    voltage_coefficient_um_per_V_s: float = parameter(
        1.652, unit="um/(V.s)", text="factor of u: drive of the slow part", tunable=True
    )
    rate_coefficient_um_per_V: float = parameter(
        0.818, unit="um/V", text="factor of u': what follows at once", tunable=True
    )
    magnitude_coefficient_1_per_s: float = parameter(
        -0.22, unit="1/s", low=-1e4, high=1e4, text="factor of |w|: asymmetry of the relaxation", tunable=True
    )
    quadratic_coefficient_1_per_um_s: float = parameter(
        -0.124,
        unit="1/(um.s)",
        high=0.0,
        text="factor of w |w|: relaxation that stiffens",
        tunable=True,
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (a, b, c, d, e) of w' = a w + b u + c u' + d |w| + e w |w|."""
    del beam
    return (
        settings.displacement_coefficient_1_per_s,
        settings.voltage_coefficient_um_per_V_s,
        settings.rate_coefficient_um_per_V,
        settings.magnitude_coefficient_1_per_s,
        settings.quadratic_coefficient_1_per_um_s,
    )


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return the state (z,) at rest: no displacement at no voltage."""
    del constants
    return (0.0,)


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the longest sub-step: a small part of the shortest time constant over the stroke."""
    del beam
    linear = abs(settings.displacement_coefficient_1_per_s) + abs(settings.magnitude_coefficient_1_per_s)
    quickest = linear + 2.0 * abs(settings.quadratic_coefficient_1_per_um_s) * STROKE_UM
    limit = STEP_PART / quickest if quickest > 0.0 else math.inf
    return limit, limit


def corner(state: tuple[float, ...], constants: tuple[float, ...], h: float, u0: float, um: float, u1: float) -> float:
    """Return the fraction of the sub-step at which a ramp takes w through zero, where |w| has its kink, 1 for none."""
    del h
    if u0 == u1:
        return 1.0
    z, c = state[0], constants[2]
    return first_crossing(z + c * u0, z + c * um, z + c * u1, 0.0)


def step(
    state: tuple[float, ...],
    constants: tuple[float, ...],
    time_s: float,
    h: float,
    u0: float,
    um: float,
    u1: float,
) -> tuple[tuple[float, ...], float, float, float]:
    """Advance z over one sub-step (classical Runge-Kutta; the middle by the cubic through both ends)."""
    del time_s
    a, b, c, d, e = constants
    z0 = state[0]
    bm = b * um
    cm = c * um
    half = 0.5 * h
    w0 = z0 + c * u0
    k1 = a * w0 + b * u0 + (d + e * w0) * abs(w0)
    w = z0 + half * k1 + cm
    k2 = a * w + bm + (d + e * w) * abs(w)
    w = z0 + half * k2 + cm
    k3 = a * w + bm + (d + e * w) * abs(w)
    w = z0 + h * k3 + c * u1
    k4 = a * w + b * u1 + (d + e * w) * abs(w)
    z1 = z0 + h * (k1 + 2.0 * (k2 + k3) + k4) / 6.0
    w1 = z1 + c * u1
    slope = a * w1 + b * u1 + (d + e * w1) * abs(w1)
    middle = 0.5 * (z0 + z1) + 0.125 * h * (k1 - slope)
    return (z1,), w0, middle + cm, w1
