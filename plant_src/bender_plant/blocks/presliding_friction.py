"""Friction with presliding, a force of the velocity v: w -> w + f z, z from -1 to 1.

    d z' = v - |v| z                                                                                      (Dahl)

v is the command, a velocity, and w the force that it meets: a damper, a slide, a seal, a joint that is moved at a
given speed. Where v turns, the contact first yields elastically over a way d, then slides with f: a saturation of the
velocity with a loop, which depends on the way and not on time. Viscous friction is the gain beside it. With the way as
the command instead of the velocity the same force is `rate_independent_hysteresis`.

f may have either sign, as the reading may count the force or its reaction; f = 0 is none. (Dahl, A solid friction
model, Aerospace Corporation 1968; the LuGre model without Stribeck's fall, Canudas de Wit and others, IEEE Transactions
on Automatic Control 40, 1995, doi:10.1109/9.376053.)
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parabola import first_crossing
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "presliding_friction"
STAGE = "material"
TITLE = "Friction with presliding"
MEMORY = True
BESIDE = "voltage"
SHORT, SETTLED, NEARLY_ALL = 0.1, 1e-7, 0.99
"""Part of the way d that passes for a parabola where z turns round; what of z is left before it slides; the part of a
sub-step from which on it is not cut."""


@dataclass(frozen=True, slots=True)
class Parameters:
    """The force of sliding, and the way of the presliding."""

    force_um: float = parameter(0.0, unit="um", text="f, friction in sliding, in the unit of the reading", tunable=True)
    slip_V_s: float = parameter(
        1.0, unit="V.s", low=1e-30, text="d, way of presliding: velocity times time", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (f in um, d in V s)."""
    del beam
    return settings.force_um, settings.slip_V_s


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (z,) of a contact without load."""
    del constants
    return (0.0,)


def slid(z: float, way: float) -> float:
    """Return z behind a way in one direction, counted in d."""
    if way == 0.0:
        return z
    end = math.copysign(1.0, way)
    return end + (z - end) * math.exp(-abs(way))


def corner(
    state: tuple[float, ...], constants: tuple[float, ...], h: float,
    w0: float, wm: float, w1: float, v0: float, vm: float, v1: float,
) -> float:  # fmt: skip
    """Return the fraction of the sub-step at which v turns round, or z has moved as far as a parabola reaches."""
    del w0, wm, w1
    f, d = constants
    if f == 0.0:
        return 1.0
    turn = first_crossing(v0, vm, v1, 0.0)
    fastest = max(abs(v0), abs(vm), abs(v1))
    if fastest == 0.0:
        return turn
    left = abs(math.copysign(1.0, vm) - state[0])
    if left <= SETTLED:
        return turn
    reach = SHORT * (2.0 / left) ** (1.0 / 3.0) * d / (fastest * h)
    return min(turn, reach) if reach < NEARLY_ALL else turn


def beside(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float,
    w0: float, wm: float, w1: float, v0: float, vm: float, v1: float,
) -> tuple[tuple[float, ...], float, float, float]:  # fmt: skip
    """Add the friction; within a sub-step v has one sign."""
    del time_s
    f, d = constants
    z0 = state[0]
    part = h / (24.0 * d)
    zm = slid(z0, part * (5.0 * v0 + 8.0 * vm - v1))
    z1 = slid(zm, part * (8.0 * vm + 5.0 * v1 - v0))
    return (z1,), w0 + f * z0, wm + f * zm, w1 + f * z1
