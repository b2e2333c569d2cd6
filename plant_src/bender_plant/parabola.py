"""Parabolas over a sub-step, given by their values at its start, middle and end."""

import math

NEGLIGIBLE = 1e-9


def value(u0: float, um: float, u1: float, fraction: float) -> float:
    """Return the parabola at `fraction` (0 to 1) of the sub-step."""
    return u0 + fraction * (4.0 * um - 3.0 * u0 - u1) + 2.0 * fraction * fraction * (u0 + u1 - 2.0 * um)


def cut(u0: float, um: float, u1: float, fraction: float) -> tuple[float, float, float, float]:
    """Cut at `fraction`; returns the middle of the left part, the cut, the middle of the right part, the end."""
    return (
        value(u0, um, u1, 0.5 * fraction),
        value(u0, um, u1, fraction),
        value(u0, um, u1, 0.5 + 0.5 * fraction),
        u1,
    )


def turning_point(u0: float, um: float, u1: float) -> float:
    """Return the fraction at which the parabola turns, 1 where it does not turn inside the sub-step."""
    slope = 4.0 * um - 3.0 * u0 - u1
    bend = 2.0 * (u0 + u1 - 2.0 * um)
    if abs(bend) <= NEGLIGIBLE * (abs(u0) + abs(um) + abs(u1)):
        return 1.0
    fraction = -0.5 * slope / bend
    return fraction if NEGLIGIBLE < fraction < 1.0 - NEGLIGIBLE else 1.0


def first_crossing(u0: float, um: float, u1: float, level: float) -> float:
    """Return the fraction at which the parabola first passes `level`, 1 where it does not inside the sub-step."""
    slope = 4.0 * um - 3.0 * u0 - u1
    bend = 2.0 * (u0 + u1 - 2.0 * um)
    offset = u0 - level
    discriminant = slope * slope - 4.0 * bend * offset
    if discriminant <= 0.0:
        return 1.0
    # the stable form of the two roots: no difference of nearly equal numbers
    q = -0.5 * (slope + math.copysign(math.sqrt(discriminant), slope))
    roots = [offset / q] if q != 0.0 else []
    if bend != 0.0:
        roots.append(q / bend)
    inside = [root for root in roots if NEGLIGIBLE < root < 1.0 - NEGLIGIBLE]
    return min(inside, default=1.0)
