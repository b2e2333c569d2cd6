"""The first mode with a restoring force or a damping that is not linear.

The linear part is solved with the collocation of `lobatto`, the rest is iterated as a drive until it rests.
"""

import numpy as np
from bender_proving.physics.lobatto import NODES, SLOTS, A, Array, mode_matrices, slot_of
from numba import njit

CUBIC, SINE = range(2)
_LIMIT = 200
_TOLERANCE = 1e-12
_ESCAPED_UM = 1e4


@njit(cache=True)
def _excess(kind: int, q: float, a: float, b: float) -> float:
    """Restoring force over omega^2, without its linear part q."""
    if kind == CUBIC:
        return a * q * q * q * (1.0 + b * q * q)
    if a > 0.0:
        return np.sinh(np.sqrt(6.0 * a) * q) / np.sqrt(6.0 * a) - q
    if a < 0.0:
        return np.sin(np.sqrt(-6.0 * a) * q) / np.sqrt(-6.0 * a) - q
    return 0.0


@njit(cache=True)
def _sweep(q: Array, p: Array, drive: Array, step_s: float, from_start: Array, from_drive: Array) -> float:
    """Position and speed at the nodes under a given drive, in place; the largest change of the speed."""
    change = 0.0
    for j in range(1, NODES):
        total = from_start[j] * p[0]
        for k in range(NODES):
            total += from_drive[j, k] * drive[k]
        change = max(change, abs(total - p[j]))
        p[j] = total
    for j in range(1, NODES):
        total = 0.0
        for k in range(NODES):
            total += A[j, k] * p[k]
        q[j] = q[0] + step_s * total
    return change


@njit(cache=True)
def single_mode(
    source: Array, step_s: Array, omega: float, zeta: float, kind: int, a: float, b: float, drag: float
) -> tuple[Array, Array]:
    """Q'' + 2 zeta omega q' + drag |q'| q' + omega^2 (q + excess(q) - source) = 0 from rest.

    The excess is a q^3 (1 + b q^2) for CUBIC and that of a sinh (a > 0) or a sine (a < 0) with the cubic term a q^3
    for SINE; `drag` is in 1/um. Returns q and q' at the nodes, shape (n, 5), nan from where q left all bounds.
    """
    q = np.full_like(source, np.nan)
    p = np.full_like(source, np.nan)
    from_start = np.empty((SLOTS, NODES))
    from_drive = np.empty((SLOTS, NODES, NODES))
    known_s = np.zeros(SLOTS)
    drive = np.empty(NODES)
    q0, p0, slot, made, stiffness = 0.0, 0.0, 0, 0, omega * omega
    for i in range(source.shape[0]):
        h = step_s[i]
        slot = slot_of(h, known_s, slot)
        if slot < 0:
            slot, made = made % SLOTS, made + 1
            known_s[slot] = h
            mode_matrices(h, omega, zeta, from_start[slot], from_drive[slot])
        for k in range(NODES):
            q[i, k], p[i, k] = q0, p0
        for _ in range(_LIMIT):
            for k in range(NODES):
                bend = _excess(kind, q[i, k], a, b)
                drive[k] = stiffness * (source[i, k] - q0 - bend) - drag * abs(p[i, k]) * p[i, k]
            change = _sweep(q[i], p[i], drive, h, from_start[slot], from_drive[slot])
            if not change < 1e12 or change <= _TOLERANCE * (omega + abs(p0)):
                break
        q0, p0 = q[i, NODES - 1], p[i, NODES - 1]
        if not abs(q0) < _ESCAPED_UM:
            q[i:] = np.nan
            p[i:] = np.nan
            break
    return q, p
