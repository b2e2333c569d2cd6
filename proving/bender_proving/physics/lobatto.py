"""Five-point Lobatto IIIA collocation, the integrator of every stage of the bench.

The stages form a chain without feedback, so each may be solved over the whole record before the next one; because all
of them collocate at the same nodes, the result is that of the method applied to the chain as one system: order 8 at
the ends of the sub-steps, stable for stiff lags. Both ends of a sub-step are nodes, so a jump between two sub-steps
is met exactly from either side. (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.7.)
"""

import numpy as np
from numba import njit
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

Array = NDArray[np.float64]

NODES = 5
SLOTS = 64
C = np.array([0.0, 0.5 - np.sqrt(21.0) / 14.0, 0.5, 0.5 + np.sqrt(21.0) / 14.0, 1.0])


def _integrals() -> Array:
    """A[j, k], the integral from 0 to C[j] of the k-th Lagrange polynomial of the nodes."""
    table = np.zeros((NODES, NODES))
    for k in range(NODES):
        others = np.delete(C, k)
        lagrange = Polynomial.fromroots(others) / np.prod(C[k] - others)
        table[:, k] = lagrange.integ()(C)
    table[0] = 0.0
    return table


A = _integrals()


@njit(cache=True)
def slot_of(step_s: float, known_s: Array, first: int) -> int:
    """Where matrices for this step are kept, looking from `first`; -1 where they still have to be made.

    Steps of an even grid differ by rounding only, so what differs by a billionth counts as the same.
    """
    for k in range(SLOTS):
        slot = (first + k) % SLOTS
        if abs(step_s - known_s[slot]) <= 1e-9 * step_s:
            return slot
    return -1


@njit(cache=True)
def _fill(matrix: Array, driven: Array, scale: float, from_start: Array, from_drive: Array) -> None:
    inverse = np.linalg.inv(matrix)
    product = inverse @ driven
    for j in range(NODES):
        total = 0.0
        for k in range(NODES):
            total += inverse[j, k]
            from_drive[j, k] = scale * product[j, k]
        from_start[j] = total


@njit(cache=True)
def lag_matrices(kappa: float, from_start: Array, from_source: Array) -> None:
    """Fill what a lag takes from its start and from its source over a sub-step of `kappa` time constants.

    Loops in the place of array expressions: what numba makes of those takes seconds to compile.
    """
    matrix = np.empty((NODES, NODES))
    for j in range(NODES):
        for k in range(NODES):
            matrix[j, k] = (1.0 if j == k else 0.0) + kappa * A[j, k]
    _fill(matrix, A, kappa, from_start, from_source)


@njit(cache=True)
def lag(source: Array, step_s: Array, tau_s: float, start: float) -> Array:
    """First-order lag tau x' = source - x at the nodes, shape (n, 5), from x = start."""
    x = np.empty_like(source)
    from_start = np.empty((SLOTS, NODES))
    from_source = np.empty((SLOTS, NODES, NODES))
    known_s = np.zeros(SLOTS)
    x0, slot, made = start, 0, 0
    for i in range(source.shape[0]):
        slot = slot_of(step_s[i], known_s, slot)
        if slot < 0:
            slot, made = made % SLOTS, made + 1
            known_s[slot] = step_s[i]
            lag_matrices(step_s[i] / tau_s, from_start[slot], from_source[slot])
        x[i, 0] = x0
        for j in range(1, NODES):
            total = from_start[slot, j] * x0
            for k in range(NODES):
                total += from_source[slot, j, k] * source[i, k]
            x[i, j] = total
        x0 = x[i, NODES - 1]
    return x


@njit(cache=True)
def varying_lag(source: Array, step_s: Array, rate: Array, start: float) -> Array:
    """Lag whose rate 1/tau is given at the nodes (1/s): x' = rate (source - x), shape (n, 5)."""
    x = np.empty_like(source)
    x0 = start
    for i in range(source.shape[0]):
        matrix = np.eye(NODES)
        right = np.full(NODES, x0)
        for j in range(1, NODES):
            for k in range(NODES):
                weight = step_s[i] * A[j, k] * rate[i, k]
                matrix[j, k] += weight
                right[j] += weight * source[i, k]
        x[i] = np.linalg.solve(matrix, right)
        x0 = x[i, NODES - 1]
    return x


@njit(cache=True)
def mode_matrices(step_s: float, omega: float, zeta: float, from_start: Array, from_drive: Array) -> None:
    """Fill what the speed at the nodes takes from its start and from the acceleration that drives it."""
    ha, matrix = np.empty((NODES, NODES)), np.empty((NODES, NODES))
    for j in range(NODES):
        for k in range(NODES):
            ha[j, k] = step_s * A[j, k]
    squared = ha @ ha
    for j in range(NODES):
        for k in range(NODES):
            unit = 1.0 if j == k else 0.0
            matrix[j, k] = unit + 2.0 * zeta * omega * ha[j, k] + omega * omega * squared[j, k]
    _fill(matrix, ha, 1.0, from_start, from_drive)


@njit(cache=True)
def linear_mode(source: Array, step_s: Array, omega: float, zeta: float) -> tuple[Array, Array]:
    """Q'' + 2 zeta omega q' + omega^2 (q - source) = 0 from rest: q and q' at the nodes, shape (n, 5) each."""
    q = np.empty_like(source)
    p = np.empty_like(source)
    from_start = np.empty((SLOTS, NODES))
    from_drive = np.empty((SLOTS, NODES, NODES))
    known_s = np.zeros(SLOTS)
    q0, p0, slot, made, stiffness = 0.0, 0.0, 0, 0, omega * omega
    for i in range(source.shape[0]):
        h = step_s[i]
        slot = slot_of(h, known_s, slot)
        if slot < 0:
            slot, made = made % SLOTS, made + 1
            known_s[slot] = h
            mode_matrices(h, omega, zeta, from_start[slot], from_drive[slot])
        p[i, 0], q[i, 0] = p0, q0
        for j in range(1, NODES):
            total = from_start[slot, j] * p0
            for k in range(NODES):
                total += from_drive[slot, j, k] * stiffness * (source[i, k] - q0)
            p[i, j] = total
        for j in range(1, NODES):
            total = 0.0
            for k in range(NODES):
                total += A[j, k] * p[i, k]
            q[i, j] = q0 + h * total
        p0, q0 = p[i, NODES - 1], q[i, NODES - 1]
    return q, p
