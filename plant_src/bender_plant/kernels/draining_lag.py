"""A lag that loses by another law than in proportion to its level.

tau y' = w - g(y, a)

    TANK        g = 2 a (sqrt(1 + y / a) - 1)           a: head over the outlet (Torricelli)
    RADIATION   g = a / 4 ((1 + y / a)^4 - 1)           a: absolute temperature at rest (Stefan and Boltzmann)
    DRAG        g = y + a y |y|                         a: over the reading (Newton)
"""

import math

from bender_plant.kernels.first_order_lag import lag_step

TANK, RADIATION, DRAG = 0, 1, 2
NEARLY_EMPTY = 0.01
"""Of the head: below it the outflow falls in a straight line, so that no slope is endless."""
TURNS = 4


def loss(y: float, size: float, law: int) -> float:
    """Return g(y), near rest y itself."""
    if law == DRAG:
        return y + size * y * abs(y)
    part = y / size
    if law == RADIATION:
        # nothing is colder than nought
        return y * (1.0 + part * (1.5 + part * (1.0 + 0.25 * part))) if part > -1.0 else -0.25 * size
    if 1.0 + part >= NEARLY_EMPTY:
        return 2.0 * y / (math.sqrt(1.0 + part) + 1.0)
    root = math.sqrt(NEARLY_EMPTY)
    return 2.0 * size * (root - 1.0) + size * (1.0 + part - NEARLY_EMPTY) / root


def steepness(y: float, size: float, law: int) -> float:
    """Return g'(y), by which the lag is quicker there; never nothing."""
    if law == DRAG:
        return 1.0 + 2.0 * size * abs(y)
    part = 1.0 + y / size
    if law == RADIATION:
        return max(part, 0.1) ** 3
    return 1.0 / math.sqrt(max(part, NEARLY_EMPTY))


def level_held(w: float, size: float, law: int) -> float:
    """Return the level at which the loss is w, of radiation and drag; -inf where none is so small."""
    if law == DRAG:
        return 2.0 * w / (1.0 + math.sqrt(1.0 + 4.0 * size * abs(w)))
    return size * math.expm1(0.25 * math.log1p(4.0 * w / size)) if 4.0 * w > -size else -math.inf


def losing_step(
    y: float, tau: float, size: float, law: int, h: float, w0: float, wm: float, w1: float
) -> tuple[float, float]:  # fmt: skip
    """Advance by h under the parabola through w0, wm, w1; returns (y at h/2, y at h).

    The tangent of the loss at the start makes a lag; what departs from it joins the inflow and is found by iteration.
    A loss that steepens is kept between its start and the levels that the inflow holds: there the iteration may run
    away where a step is long for it.
    """
    k = steepness(y, size, law)
    beyond = y - loss(y, size, law) / k
    start, m, e = w0 / k + beyond, wm / k + beyond, w1 / k + beyond
    middle, end = lag_step(y, tau / k, h, start, m, e)
    for _ in range(TURNS):
        m, e = wm / k + middle - loss(middle, size, law) / k, w1 / k + end - loss(end, size, law) / k
        middle, end = lag_step(y, tau / k, h, start, m, e)
        if law != TANK:
            low = min(y, level_held(min(w0, wm, w1), size, law))
            high = max(y, level_held(max(w0, wm, w1), size, law))
            middle, end = min(max(middle, low), high), min(max(end, low), high)
    return middle, end
