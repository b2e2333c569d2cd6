"""A lag whose outflow is a power of its level.

tau y' = w - g(y),      g(y) = H / p ((1 + y / H)^p - 1)

p = 1/2: a tank (Torricelli), p = 4: a wall that radiates (Stefan and Boltzmann).
"""

import math

from bender_plant.kernels.first_order_lag import lag_step

NEARLY_EMPTY = 0.01
"""Of the head: below it the outflow falls in a straight line, so that no slope is endless."""
TURNS = 4


def radiated(y: float, head: float) -> float:
    """Return g(y) for p = 4, y itself where the head is far larger; level at the absolute zero."""
    part = y / head
    if part < -1.0:
        return -0.25 * head
    return y * (1.0 + part * (1.5 + part * (1.0 + 0.25 * part)))


def radiating_step(
    y: float, tau: float, head: float, h: float, w0: float, wm: float, w1: float
) -> tuple[float, float]:  # fmt: skip
    """Advance by h under the parabola through w0, wm, w1 with p = 4; returns (y at h/2, y at h)."""
    start = w0 + y - radiated(y, head)
    middle, end = lag_step(y, tau, h, start, wm + start - w0, w1 + start - w0)
    for _ in range(TURNS):
        m, e = wm + middle - radiated(middle, head), w1 + end - radiated(end, head)
        middle, end = lag_step(y, tau, h, start, m, e)
    return middle, end


def outflow(y: float, head: float) -> float:
    """Return g(y) for p = 1/2, a flow over the gain of the inflow: y itself where the head is far larger."""
    part = 1.0 + y / head
    if part >= NEARLY_EMPTY:
        return 2.0 * y / (math.sqrt(part) + 1.0)
    root = math.sqrt(NEARLY_EMPTY)
    return 2.0 * head * (root - 1.0) + head * (part - NEARLY_EMPTY) / root


def draining_step(
    y: float, tau: float, head: float, h: float, w0: float, wm: float, w1: float
) -> tuple[float, float]:  # fmt: skip
    """Advance by h under the parabola through w0, wm, w1 with p = 1/2; returns (y at h/2, y at h).

    What departs from a linear outflow joins the inflow and is found by iteration.
    """
    start = w0 + y - outflow(y, head)
    middle, end = lag_step(y, tau, h, start, wm + start - w0, w1 + start - w0)
    for _ in range(TURNS):
        m, e = wm + middle - outflow(middle, head), w1 + end - outflow(end, head)
        middle, end = lag_step(y, tau, h, start, m, e)
    return middle, end
