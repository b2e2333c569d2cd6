"""Two small memories that only the effects outside the catalogue have."""

import numpy as np
from bender_proving.physics.lobatto import Array
from numba import njit


@njit(cache=True)
def ratchet(voltage_V: Array, elapsed_s: Array, um_per_V: float, widest_um: float, tau_s: float) -> Array:
    """A gap that opens while the voltage falls, up to `widest_um`, and closes by itself with `tau_s`; shape (n, 5).

    `elapsed_s` is the time from the node before, shape (n, 5).
    """
    gap = np.empty_like(voltage_V)
    x, before = 0.0, 0.0
    for i in range(voltage_V.shape[0]):
        for j in range(voltage_V.shape[1]):
            x = x * np.exp(-elapsed_s[i, j] / tau_s)
            fall = before - voltage_V[i, j]
            if fall > 0.0:
                x = min(widest_um, x + um_per_V * fall)
            before = voltage_V[i, j]
            gap[i, j] = x
    return gap


def telegraph(step_s: Array, tilt: Array, pace_s: float, seed: int) -> Array:
    """States 0 and 1 of a Markov chain over the sub-steps, shape (n,), from 0.

    It leaves 0 at the rate exp(tilt) / pace_s and 1 at exp(-tilt) / pace_s, so a positive tilt favours 1.
    """
    chances = np.random.default_rng(seed).random(len(step_s))
    return _walk(step_s, tilt, pace_s, chances)


@njit(cache=True)
def _walk(step_s: Array, tilt: Array, pace_s: float, chances: Array) -> Array:
    states = np.zeros(len(step_s))
    state = 0.0
    for i in range(len(step_s)):
        sign = 1.0 if state == 0.0 else -1.0
        if chances[i] < -np.expm1(-step_s[i] / pace_s * np.exp(sign * tilt[i])):
            state = 1.0 - state
        states[i] = state
    return states
