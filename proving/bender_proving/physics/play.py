"""Play between the tip and what is read of it, with the turning points of the tip met between the nodes."""

import numpy as np
from bender_proving.physics.lobatto import NODES, Array, C
from numba import njit


@njit(cache=True)
def _turn(q0: float, q1: float, p0: float, p1: float, h: float) -> float:
    """The extremum between two nodes where the speed changes sign, on the cubic through values and speeds."""
    a = 3.0 * (p0 + p1) * h - 6.0 * (q1 - q0)
    b = 6.0 * (q1 - q0) - (4.0 * p0 + 2.0 * p1) * h
    c = p0 * h
    root = np.sqrt(max(b * b - 4.0 * a * c, 0.0))
    lower = b + root if b > 0.0 else b - root
    x = -2.0 * c / lower if lower != 0.0 else 0.5
    if not 0.0 <= x <= 1.0:
        x = -0.5 * lower / a if a != 0.0 else 0.5
    x = min(max(x, 0.0), 1.0)
    return q0 + x * (c + x * (0.5 * b + x * a / 3.0))


@njit(cache=True)
def play(q: Array, p: Array, step_s: Array, half_width_um: float) -> Array:
    """The follower y of the tip q with speed p, shapes (n, 5), |q - y| <= half_width_um, from y = 0."""
    out = np.empty_like(q)
    y = 0.0
    for i in range(q.shape[0]):
        for j in range(NODES):
            if j > 0 and p[i, j - 1] * p[i, j] < 0.0:
                h = step_s[i] * (C[j] - C[j - 1])
                top = _turn(q[i, j - 1], q[i, j], p[i, j - 1], p[i, j], h)
                y = min(max(y, top - half_width_um), top + half_width_um)
            y = min(max(y, q[i, j] - half_width_um), q[i, j] + half_width_um)
            out[i, j] = y
    return out
