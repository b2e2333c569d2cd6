"""The play of half-width r, F -> max(u - r, min(u + r, F)), along monotone stretches of its input."""

from bender_plant.parabola import first_crossing, negligible, turning_point


def play(x: float, u: float, r: float) -> float:
    """Return the play of half-width r, last at x, after a monotone stretch that ends at u."""
    return max(u - r, min(u + r, x))


def first_engagement(state: tuple[float, ...], thresholds: tuple[float, ...], u0: float, um: float, u1: float) -> float:
    """Return the fraction of the sub-step at which a play engages or the voltage turns, 1 for none."""
    if u0 == um == u1:
        return 1.0
    first, least = 1.0, negligible(u0, um, u1)
    if (4.0 * um - 3.0 * u0 - u1) * (u0 + 3.0 * u1 - 4.0 * um) >= 0.0:
        # it does not turn, and passes only levels strictly between its ends: a play that is pushed stands at its start
        low, high = min(u0, u1) + least, max(u0, u1) - least
    else:
        first = turning_point(u0, um, u1)
        # a parabola stays between its ends and the point where its tangents meet
        apex = 2.0 * um - 0.5 * (u0 + u1)
        low, high = min(u0, apex, u1) - least, max(u0, apex, u1) + least
    for k in range(len(thresholds)):
        r = thresholds[k]
        x = play(state[k], u0, r)
        if low <= x + r <= high:
            first = min(first, first_crossing(u0, um, u1, x + r))
        if low <= x - r <= high:
            first = min(first, first_crossing(u0, um, u1, x - r))
    return first
