"""Rate-independent memory as a differential equation in the voltage, advanced along its path.

Dahl (AIAA Journal 14, 1976): dh/dv = slope |1 - s h / limit|^n sign(1 - s h / limit), s the direction of the move.
Duhem (as Coleman and Hodgdon, Int. J. Eng. Sci. 24, 1986): dh/dv = s (f(v) - h) / reach + g(v), with an anhysteretic
curve f that bends around the middle voltage and a reversible slope g below that of f.
"""

import math

import numpy as np
from bender_proving.physics.lobatto import Array
from numba import njit

_STRIDE_V = 0.1

DAHL, DUHEM = range(2)


@njit(cache=True)
def _slope(kind: int, h: float, v: float, direction: float, p: Array) -> float:
    if kind == DAHL:
        limit_V, power = p[0], p[1]
        room = 1.0 - direction * h / limit_V
        return math.copysign(abs(room) ** power, room)
    reach_V, middle_V, bend_V, reversible = p[0], p[1], p[2], p[3]
    at = math.tanh((v - middle_V) / bend_V)
    curve = bend_V * (at + math.tanh(middle_V / bend_V))
    return direction * (curve - h) / reach_V + reversible * (1.0 - at * at)


@njit(cache=True)
def respond(kind: int, p: Array, path_V: Array) -> Array:
    """Output for a path of voltages, shape (n,), from 0 at 0 V, in strides of at most 0.1 V (Runge-Kutta, order 4).

    `p` is (limit_V, power) for DAHL and (reach_V, middle_V, bend_V, reversible) for DUHEM; the output is in V.
    """
    out = np.zeros(len(path_V))
    v, h = 0.0, 0.0
    for i in range(len(path_V)):
        move = path_V[i] - v
        if move != 0.0:
            s = 1.0 if move > 0.0 else -1.0
            strides = math.ceil(abs(move) / _STRIDE_V)
            dv = move / strides
            for k in range(strides):
                at = v + k * dv
                k1 = _slope(kind, h, at, s, p)
                k2 = _slope(kind, h + 0.5 * dv * k1, at + 0.5 * dv, s, p)
                k3 = _slope(kind, h + 0.5 * dv * k2, at + 0.5 * dv, s, p)
                k4 = _slope(kind, h + dv * k3, at + dv, s, p)
                h += dv / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            v = path_V[i]
        out[i] = h
    return out
