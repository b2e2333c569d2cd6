"""The bench without anything hidden: equation (30) of the paper, then the first bending mode.

w' = -0.48 w + 1.652 v + 0.818 v' - 0.22 |w| - 0.124 w |w|  (v in V, w in um) is advanced as z = w - 0.818 v, which
stays smooth where the held voltage jumps. The mode is q'' + 2 zeta omega q' + omega^2 (q - w) = 0, the tip y = q.
"""

import math

import numpy as np
from bender_proving.physics.lobatto import NODES, A, Array
from numba import njit

FULL_VOLTAGE_V = 50.0
FREQUENCY_HZ = 104.37328430533374
OMEGA = 2.0 * math.pi * FREQUENCY_HZ
ZETA = 0.02
_LINEAR, _DRIVE, _FAST, _EVEN, _ODD = 0.48, 1.652, 0.818, 0.22, 0.124
_PICARD_LIMIT = 60
_PICARD_TOLERANCE_UM = 1e-12


def settled_um(voltage_V: float) -> float:
    """Displacement to which (30) settles under a voltage held for ever; 0 V and above."""
    if voltage_V < 0.0:
        raise ValueError(f"voltage_V must be at least 0, found {voltage_V!r}")
    slope = _LINEAR + _EVEN
    return (math.sqrt(slope * slope + 4.0 * _ODD * _DRIVE * voltage_V) - slope) / (2.0 * _ODD)


FULL_STROKE_UM = settled_um(FULL_VOLTAGE_V)
GAIN_UM_PER_V = FULL_STROKE_UM / FULL_VOLTAGE_V
"""Of a linear bench: the same stroke, in proportion."""


@njit(cache=True)
def material(voltage_V: Array, step_s: Array) -> Array:
    """W of (30) in um at the nodes, shape (n, 5), from w = 0 at v = 0; voltages may jump between sub-steps."""
    w = np.empty_like(voltage_V)
    z = np.zeros(NODES)
    rate = np.zeros(NODES)
    z0 = 0.0
    for i in range(voltage_V.shape[0]):
        z[:] = z0
        for _ in range(_PICARD_LIMIT):
            for k in range(NODES):
                x = z[k] + _FAST * voltage_V[i, k]
                rate[k] = _DRIVE * voltage_V[i, k] - _LINEAR * x - _EVEN * abs(x) - _ODD * x * abs(x)
            change = 0.0
            for j in range(1, NODES):
                total = 0.0
                for k in range(NODES):
                    total += A[j, k] * rate[k]
                new = z0 + step_s[i] * total
                change = max(change, abs(new - z[j]))
                z[j] = new
            if change < _PICARD_TOLERANCE_UM:
                break
        for k in range(NODES):
            w[i, k] = z[k] + _FAST * voltage_V[i, k]
        z0 = z[NODES - 1]
    return w
