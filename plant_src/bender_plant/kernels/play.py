"""The play of half-width r, F -> max(u - r, min(u + r, F)), along monotone stretches of its input."""

from bender_plant.parabola import first_crossing, negligible, turning_point


def play(x: float, u: float, r: float) -> float:
    """Return the play of half-width r, last at x, after a monotone stretch that ends at u."""
    return max(u - r, min(u + r, x))


def passed(u0: float, um: float, u1: float) -> tuple[float, float, float]:
    """Return the fraction of the sub-step at which the voltage turns, 1 for none, and the levels that it passes."""
    least = negligible(u0, um, u1)
    if (4.0 * um - 3.0 * u0 - u1) * (u0 + 3.0 * u1 - 4.0 * um) >= 0.0:
        # it does not turn, and passes only levels strictly between its ends: a play that is pushed stands at its start
        return 1.0, min(u0, u1) + least, max(u0, u1) - least
    # a parabola stays between its ends and the point where its tangents meet
    apex = 2.0 * um - 0.5 * (u0 + u1)
    return turning_point(u0, um, u1), min(u0, apex, u1) - least, max(u0, apex, u1) + least


def engagement(x: float, r: float, first: float, low: float, high: float, u0: float, um: float, u1: float) -> float:
    """Return the fraction of the sub-step at which one play, at x, engages, or `first` where that is earlier.

    Args:
        x: the play at the beginning of the sub-step.
        r: its half-width.
        first: fraction at which something else happens.
        low: the lowest level that the voltage passes.
        high: the highest one.
        u0: voltage at the beginning.
        um: in the middle.
        u1: at the end.
    """
    if low <= x + r <= high:
        first = min(first, first_crossing(u0, um, u1, x + r))
    if low <= x - r <= high:
        first = min(first, first_crossing(u0, um, u1, x - r))
    return first


def first_engagement(state: tuple[float, ...], thresholds: tuple[float, ...], u0: float, um: float, u1: float) -> float:
    """Return the fraction of the sub-step at which a play engages or the voltage turns, 1 for none."""
    if u0 == um == u1:
        return 1.0
    first, low, high = passed(u0, um, u1)
    for k in range(len(thresholds)):
        first = engagement(play(state[k], u0, thresholds[k]), thresholds[k], first, low, high, u0, um, u1)
    return first
