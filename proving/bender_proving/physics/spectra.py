"""Creep as many slow copies: retardation spectra of Kelvin-Voigt units with time constants even in log time."""

import math

import numpy as np
from bender_proving.physics.lobatto import NODES, SLOTS, A, Array, lag_matrices, slot_of
from numba import njit
from scipy.optimize import nnls

UNITS = 28
TAU_S = np.geomspace(0.03, 600.0, UNITS)
EARLY_S, LATE_S = 0.1, 100.0
_NEAR, _TERMS = 0.05, 10
_POWERS = np.array([np.linalg.matrix_power(A, m) for m in range(_TERMS)])
_POWER_SUMS = _POWERS.sum(axis=2)


def power_law(exponent: float) -> Array:
    """Weights of a compliance that grows as t^exponent over the decades of `TAU_S`, shape (28,)."""
    return TAU_S**exponent


def band(centre_s: float, width: float) -> Array:
    """Weights of a log-normal band of time constants; `width` is its standard deviation in natural logarithm."""
    return np.exp(-0.5 * (np.log(TAU_S / centre_s) / width) ** 2)


def stretched(tau_s: float, exponent: float) -> Array:
    """Non-negative weights that give 1 - exp(-(t / tau)^exponent) (Kohlrausch), by least squares over log time."""
    t = np.geomspace(0.01, 1000.0, 160)
    units = 1.0 - np.exp(-t[:, None] / TAU_S)
    return nnls(units, 1.0 - np.exp(-((t / tau_s) ** exponent)))[0]


def grown(weights: Array, tau_s: Array) -> float:
    """How much the copies grow between 0.1 s and 100 s after a unit step."""
    return float(weights @ (np.exp(-EARLY_S / tau_s) - np.exp(-LATE_S / tau_s)))


def single(tau_s: float) -> float:
    """`grown` of one unit of weight 1."""
    return math.exp(-EARLY_S / tau_s) - math.exp(-LATE_S / tau_s)


@njit(cache=True)
def _propagators(step_s: float, tau_s: Array, from_start: Array, from_source: Array) -> None:
    """Fill what each unit takes from its start and its source over a sub-step: the inverse of I + kappa A.

    A unit much slower than the sub-step, as nearly all are, is served by the power series of that inverse.
    """
    for u in range(len(tau_s)):
        kappa = step_s / tau_s[u]
        if kappa > _NEAR:
            lag_matrices(kappa, from_start[u], from_source[u])
            continue
        for j in range(1, NODES):
            value = 0.0
            for m in range(_TERMS - 1, -1, -1):
                value = _POWER_SUMS[m, j] - kappa * value
            from_start[u, j] = value
            for k in range(NODES):
                value = 0.0
                for m in range(_TERMS - 1, 0, -1):
                    value = _POWERS[m, j, k] - kappa * value
                from_source[u, j, k] = kappa * value


@njit(cache=True)
def copies(source: Array, step_s: Array, tau_s: Array, weights: Array) -> Array:
    """Weighted sum of lags of `source` at the nodes, shape (n, 5), all from 0."""
    units = len(tau_s)
    total = np.zeros_like(source)
    x = np.zeros(units)
    from_start = np.empty((SLOTS, units, NODES))
    from_source = np.empty((SLOTS, units, NODES, NODES))
    known_s = np.zeros(SLOTS)
    slot, made = 0, 0
    for i in range(source.shape[0]):
        slot = slot_of(step_s[i], known_s, slot)
        if slot < 0:
            slot, made = made % SLOTS, made + 1
            known_s[slot] = step_s[i]
            _propagators(step_s[i], tau_s, from_start[slot], from_source[slot])
        for u in range(units):
            total[i, 0] += weights[u] * x[u]
            value = x[u]
            for j in range(1, NODES):
                value = from_start[slot, u, j] * x[u]
                for k in range(NODES):
                    value += from_source[slot, u, j, k] * source[i, k]
                total[i, j] += weights[u] * value
            x[u] = value
    return total
