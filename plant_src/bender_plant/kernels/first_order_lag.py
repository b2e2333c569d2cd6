"""A first-order lag, tau v' = u - v, answered exactly under a parabola."""

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
