"""Dry friction of something that turns or slides: a lag that a constant force holds back, and that comes to rest.

    tau y' = w - y - d y |y| - f sign(y) in motion;    y = 0 at rest, for as long as |w| <= f

The speed of a motor, a pulley or a belt: tau and the gain come from inertia and viscous friction, f is the dry friction
of the bearings over the viscous one, in the unit of the speed, and d the drag of a fan beside it (`speed_drag`).
tau = 0 is none; f = 0 and d = 0 are a plain lag.

Where the place is read, the speed adds up, tau z' = y without end: speeds are counted by the way within tau. A load g
pulls one way: w + g stands for w. (Coulomb's law;
Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30, 1994, doi:10.1016/0005-1098(94)90209-7.)
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.draining_lag import DRAG, losing_step
from bender_plant.kernels.first_order_lag import lag_step
from bender_plant.parabola import INSTANT, first_crossing
from bender_plant.parameter import ModelError, check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "bearing_friction"
STAGE = "structure"
TITLE = "Bearing friction"
MEMORY = True
FORMS = ("speed", "place")


@dataclass(frozen=True, slots=True)
class Parameters:
    """Neutral with no time constant."""

    time_constant_s: float = parameter(
        0.0, unit="s", low=0.0, high=1e6, text="tau, inertia over viscous friction, 0 for none", tunable=True
    )
    friction_um: float = parameter(
        0.0, unit="um", low=0.0, text="f, dry friction over the viscous one, in the unit of the reading", tunable=True
    )
    drag_1_per_um: float = parameter(
        0.0, unit="1/um", low=0.0, text="d, drag over viscous friction and speed", tunable=True
    )
    load_um: float = parameter(
        0.0, unit="um", text="g, constant load over viscous friction, a weight or an offset of the drive", tunable=True
    )
    form: str = "speed"

    def __post_init__(self) -> None:
        check(self, ID)
        if self.form not in FORMS:
            raise ModelError(f"{ID}.form: found {self.form!r}, expected one of {FORMS}")


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (tau in s, f in um, d in 1/um, 1 where the place is read, g in um)."""
    del beam
    place = float(FORMS.index(settings.form))
    return settings.time_constant_s, settings.friction_um, settings.drag_1_per_um, place, settings.load_um


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (y, z) at rest."""
    del constants
    return (0.0, 0.0)


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the first sub-step after a jump, and the longest: where the motion turns it bends without a jump."""
    del beam
    tau = settings.time_constant_s
    if tau == 0.0:
        return math.inf, math.inf
    return (0.05 * tau, 0.1 * tau) if settings.drag_1_per_um == 0.0 else (0.02 * tau, 0.05 * tau)


def followed(
    y: float, tau: float, drag: float, force: float, h: float, w0: float, wm: float, w1: float
) -> tuple[float, float]:  # fmt: skip
    """Return y at the middle and the end of a sub-step under a constant force."""
    if drag > 0.0:
        return losing_step(y, tau, drag, DRAG, h, w0 - force, wm - force, w1 - force)
    return lag_step(y, tau, h, w0 - force, wm - force, w1 - force)


def held_back(y: float, tau: float, f: float, h: float, wm: float) -> tuple[float, bool]:
    """Return the friction over a sub-step in which neither motion nor rest ends, and whether it sets out from rest.

    What is stopped within an instant is at rest.
    """
    if abs(y) > 2.0 * INSTANT * (f + abs(wm)) * h / tau:
        return math.copysign(f, y), False
    return math.copysign(f, wm) if abs(wm) > f else 0.0, True


def corner(state: tuple[float, ...], constants: tuple[float, ...], h: float, w0: float, wm: float, w1: float) -> float:
    """Return the fraction of the sub-step at which the motion comes to rest or begins, 1 for none."""
    tau, f, drag, _, load = constants
    w0, wm, w1, y = w0 + load, wm + load, w1 + load, state[0]
    if tau == 0.0 or f == 0.0:
        return 1.0
    force, rests = held_back(y, tau, f, h, wm)
    if rests:
        begins = min(first_crossing(w0, wm, w1, f), first_crossing(w0, wm, w1, -f))
        if begins < 1.0 or force == 0.0:
            return begins
        y = 0.0
    middle, end = followed(y, tau, drag, force, h, w0, wm, w1)
    return first_crossing(y, middle, end, 0.0)


def turned(
    y: float, tau: float, f: float, drag: float, h: float, w0: float, wm: float, w1: float
) -> tuple[float, float, float]:  # fmt: skip
    """Return the speed at the start, the middle and the end of a sub-step in which neither motion nor rest ends."""
    if tau == 0.0:
        return w0, wm, w1
    if f == 0.0:
        middle, end = followed(y, tau, drag, 0.0, h, w0, wm, w1)
        return y, middle, end
    force, rests = held_back(y, tau, f, h, wm)
    if force == 0.0:
        return 0.0, 0.0, 0.0
    y = 0.0 if rests else y
    middle, end = followed(y, tau, drag, force, h, w0, wm, w1)
    # the ends of a motion are those of a sub-step: beyond them there is rounding
    middle = middle if middle * force > 0.0 else 0.0
    end = end if end * force > 0.0 else 0.0
    return y, middle, end


def step(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float, w0: float, wm: float, w1: float
) -> tuple[tuple[float, ...], float, float, float]:
    """Follow with the friction against the motion, or stay at rest; a place adds up what moves."""
    del time_s
    tau, f, drag, place, load = constants
    y0, ym, y1 = turned(state[0], tau, f, drag, h, w0 + load, wm + load, w1 + load)
    if place == 0.0 or tau == 0.0:
        return (y1, y1), y0, ym, y1
    z, part = state[1], h / (24.0 * tau)
    middle, end = z + part * (5.0 * y0 + 8.0 * ym - y1), z + 4.0 * part * (y0 + 4.0 * ym + y1)
    return (y1, end), z, middle, end
