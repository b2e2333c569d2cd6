"""Two modes that exchange energy: an autoparametric pair near the resonance 2 : 1.

x'' + 2 zeta omega x' + omega^2 (x - w) + coupling omega_2^2 y^2 = 0,
y'' + 2 zeta_2 omega_2 y' + omega_2^2 (y (1 + 2 coupling x) - share w) = 0, with omega_2 = ratio omega; both forces stem
from one potential. (Nayfeh and Mook, Nonlinear Oscillations, 1979, 6.5.)
"""

import numpy as np
from bender_proving.physics.lobatto import NODES, Array, C
from numba import njit


@njit(cache=True)
def _rates(s: Array, w: float, p: Array) -> Array:
    omega, zeta, omega2, zeta2, coupling, share = p
    pull = omega * omega * (w - s[0]) - coupling * omega2 * omega2 * s[2] * s[2]
    swing = share * w - s[2] * (1.0 + 2.0 * coupling * s[0])
    return np.array(
        [s[1], pull - 2.0 * zeta * omega * s[1], s[3], omega2 * omega2 * swing - 2.0 * zeta2 * omega2 * s[3]]
    )


@njit(cache=True)
def modes(source: Array, step_s: Array, p: Array) -> Array:
    """X at the nodes, shape (n, 5), from rest; classical Runge-Kutta (order 4) from node to node.

    `p` is (omega, zeta, omega_2, zeta_2, coupling, share) in rad/s and 1/um.
    """
    out = np.zeros_like(source)
    s = np.zeros(4)
    for i in range(source.shape[0]):
        out[i, 0] = s[0]
        for j in range(1, NODES):
            h = step_s[i] * (C[j] - C[j - 1])
            w0, w1 = source[i, j - 1], source[i, j]
            half = 0.5 * (w0 + w1)
            k1 = _rates(s, w0, p)
            k2 = _rates(s + 0.5 * h * k1, half, p)
            k3 = _rates(s + 0.5 * h * k2, half, p)
            k4 = _rates(s + h * k3, w1, p)
            s = s + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            out[i, j] = s[0]
    return out
