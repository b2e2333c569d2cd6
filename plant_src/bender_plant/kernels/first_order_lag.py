"""First-order lags, tau v' = u - v, answered exactly under a parabola."""

import math


def lag_step(v: float, tau: float, h: float, u0: float, um: float, u1: float) -> tuple[float, float]:
    """Advance tau v' = u - v by h under the parabola through u0, um, u1; returns (v at h/2, v at h)."""
    slope = (4.0 * um - 3.0 * u0 - u1) / h
    bend = 2.0 * (u0 + u1 - 2.0 * um) / (h * h)
    # v_p = A + B t + bend t^2 solves the equation under u0 + slope t + bend t^2
    B = slope - 2.0 * tau * bend
    A = u0 - tau * B
    half = 0.5 * h
    decay = math.exp(-half / tau)
    x = v - A
    return A + half * (B + bend * half) + x * decay, A + h * (B + bend * h) + x * decay * decay


def two_lags_step(
    first: float, second: float, tau: float, after: float, h: float, u0: float, um: float, u1: float
) -> tuple[float, float, float, float, float]:
    """Advance a lag of tau and one of `after` behind it, none where 0, by h under the parabola through u0, um, u1.

    Returns (first at h, second at h) and what the second gives at the start, the middle and the end.
    """
    a0, am, a1 = u0, um, u1
    if tau > 0.0:
        a0 = first
        am, a1 = lag_step(first, tau, h, u0, um, u1)
    b0, bm, b1 = a0, am, a1
    if after > 0.0:
        b0 = second
        bm, b1 = lag_step(second, after, h, a0, am, a1)
    return a1, b1, b0, bm, b1
