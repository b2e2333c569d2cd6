"""A lag whose outflow is the square root of its level.

tau y' = w - g(y),      g(y) = 2 H (sqrt(1 + y / H) - 1)
"""

import math

from bender_plant.kernels.first_order_lag import lag_step

NEARLY_EMPTY = 0.01
"""Of the head: below it the outflow falls in a straight line, so that no slope is endless."""
TURNS = 4


def outflow(y: float, head: float) -> float:
    """Return g(y), a flow over the gain of the inflow: y itself where the head is far larger."""
    part = 1.0 + y / head
    if part >= NEARLY_EMPTY:
        return 2.0 * y / (math.sqrt(part) + 1.0)
    root = math.sqrt(NEARLY_EMPTY)
    return 2.0 * head * (root - 1.0) + head * (part - NEARLY_EMPTY) / root


def draining_step(
    y: float, tau: float, head: float, h: float, w0: float, wm: float, w1: float
) -> tuple[float, float]:  # fmt: skip
    """Advance by h under the parabola through w0, wm, w1; returns (y at h/2, y at h).

    What departs from a linear outflow joins the inflow and is found by iteration.
    """
    start = w0 + y - outflow(y, head)
    middle, end = lag_step(y, tau, h, start, wm + start - w0, w1 + start - w0)
    for _ in range(TURNS):
        m, e = wm + middle - outflow(middle, head), w1 + end - outflow(end, head)
        middle, end = lag_step(y, tau, h, start, m, e)
    return middle, end
