"""Parabolas over a sub-step, given by their values at its start, middle and end."""

import math

# a distance in the signal's unit, its part of a large signal, and a fraction of a sub-step, that mean nothing: without
# them the rounding of one cut would call for the next
NEGLIGIBLE = 1e-9
NEGLIGIBLE_PART = 1e-12
INSTANT = 1e-6


def negligible(u0: float, um: float, u1: float) -> float:
    """Return the distance that means nothing to a parabola."""
    return max(NEGLIGIBLE, NEGLIGIBLE_PART * (abs(u0) + abs(um) + abs(u1)))


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
    end_slope = u0 + 3.0 * u1 - 4.0 * um
    if slope * end_slope >= 0.0:
        return 1.0
    bend = 2.0 * (u0 + u1 - 2.0 * um)
    least = negligible(u0, um, u1)
    if abs(bend) <= least or min(slope * slope, end_slope * end_slope) <= 4.0 * least * abs(bend):
        return 1.0
    fraction = -0.5 * slope / bend
    return fraction if INSTANT < fraction < 1.0 - INSTANT else 1.0


def first_crossing(u0: float, um: float, u1: float, level: float) -> float:
    """Return the fraction at which the parabola first passes `level` inside the sub-step, 1 where it does not.

    Standing on the level at the start or the end is no passing.
    """
    slope = 4.0 * um - 3.0 * u0 - u1
    bend = 2.0 * (u0 + u1 - 2.0 * um)
    offset = u0 - level
    discriminant = slope * slope - 4.0 * bend * offset
    if discriminant <= 0.0:
        return 1.0
    # the stable form of the two roots: no difference of nearly equal numbers
    q = -0.5 * (slope + math.copysign(math.sqrt(discriminant), slope))
    a = offset / q
    b = q / bend if bend != 0.0 else math.inf
    take_a = INSTANT < a < 1.0 - INSTANT
    take_b = INSTANT < b < 1.0 - INSTANT
    least = negligible(u0, um, u1)
    if abs(offset) <= least:
        if slope * slope <= 4.0 * least * abs(bend):
            return 1.0
        if abs(a) <= abs(b):
            take_a = False
        else:
            take_b = False
    if abs(u1 - level) <= least:
        if abs(a - 1.0) <= abs(b - 1.0):
            take_a = False
        else:
            take_b = False
    if take_a and take_b:
        return min(a, b)
    return a if take_a else b if take_b else 1.0
