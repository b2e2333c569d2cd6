"""The electrode voltage between two commands, in closed form.

Every supply here answers a held command by a known function of the time since that command began to act, so no
integration is needed; `corners` says where that function has a kink or is too steep for a long sub-step.
"""

import math
from dataclasses import dataclass

import numpy as np
from bender_proving.physics.lobatto import Array
from numba import njit

HOLD, SLEW, FALL, LAG = range(4)
_GRADES = np.concatenate([np.arange(0.2, 4.0, 0.2), np.arange(4.0, 16.0), np.arange(16.0, 34.0, 2.0)])


@dataclass(frozen=True, slots=True)
class Answer:
    """How the supply follows a held command c.

    HOLD: v = c. SLEW: v' = a sign(c - v) until |c - v| = a b, then the lag of time constant b. FALL: lag a towards
    c - b while v > c, held at c from there; none when rising. LAG: two lags in series, a and then b (none where 0).
    """

    kind: int = HOLD
    a: float = 0.0
    b: float = 0.0


@njit(cache=True)
def _after(
    kind: int, a: float, b: float, elapsed_s: float, inner: float, outer: float, target: float
) -> tuple[float, float]:
    error = target - outer
    if kind == HOLD or elapsed_s < 0.0:
        return target, target
    if kind == SLEW:
        ramp_s = max(0.0, abs(error) / a - b)
        if elapsed_s <= ramp_s:
            return target, outer + math.copysign(a * elapsed_s, error)
        if b <= 0.0:
            return target, target
        left = math.copysign(min(abs(error), a * b), error)
        return target, target - left * math.exp(-(elapsed_s - ramp_s) / b)
    if kind == FALL:
        if error >= 0.0:
            return target, target
        return target, max(target, target - b + (b - error) * math.exp(-elapsed_s / a))
    slow = math.exp(-elapsed_s / a)
    if b <= 0.0:
        value = target + (outer - target) * slow
        return value, value
    share = (inner - target) * a / (a - b)
    value = target + share * slow + (outer - target - share) * math.exp(-elapsed_s / b)
    return target + (inner - target) * slow, value


@njit(cache=True)
def beginnings(kind: int, a: float, b: float, act_s: Array, target_V: Array) -> Array:
    """State (inner, outer voltage) when each command begins to act, shape (n, 2), from 0 V."""
    states = np.zeros((len(act_s), 2))
    for k in range(1, len(act_s)):
        elapsed = act_s[k] - act_s[k - 1]
        inner, outer = states[k - 1, 0], states[k - 1, 1]
        states[k, 0], states[k, 1] = _after(kind, a, b, elapsed, inner, outer, target_V[k - 1])
    return states


@njit(cache=True)
def voltages(
    kind: int, a: float, b: float, act_s: Array, target_V: Array, states: Array, nodes_s: Array, middle_s: Array
) -> Array:
    """Electrode voltage at the nodes, shape (n, 5); `middle_s` says which command is acting."""
    v = np.zeros_like(nodes_s)
    k = -1
    for i in range(nodes_s.shape[0]):
        while k + 1 < len(act_s) and act_s[k + 1] <= middle_s[i]:
            k += 1
        if k < 0:
            continue
        for j in range(nodes_s.shape[1]):
            elapsed = max(0.0, nodes_s[i, j] - act_s[k])
            v[i, j] = _after(kind, a, b, elapsed, states[k, 0], states[k, 1], target_V[k])[1]
    return v


def corners(answer: Answer, act_s: Array, target_V: Array, states: Array) -> Array:
    """Instants at which a sub-step has to end, besides the commands themselves."""
    gap = np.abs(target_V - states[:, 1])
    if answer.kind == SLEW:
        ramp_s = np.maximum(0.0, gap / answer.a - answer.b)
        return _kept(act_s, ramp_s[:, None] + answer.b * np.concatenate([[0.0], _GRADES if answer.b > 0 else []]))
    if answer.kind == FALL:
        end_s = answer.a * np.log1p(gap / answer.b) if answer.b > 0.0 else np.zeros_like(gap)
        return _kept(act_s, np.column_stack([end_s, np.broadcast_to(answer.a * _GRADES, (len(gap), len(_GRADES)))]))
    if answer.kind == LAG:
        grades = np.concatenate([answer.a * _GRADES, answer.b * _GRADES if answer.b > 0 else []])
        return _kept(act_s, np.broadcast_to(grades, (len(gap), len(grades))))
    return np.empty(0)


def _kept(act_s: Array, after_s: Array) -> Array:
    following = np.append(act_s[1:], np.inf)
    instants = act_s[:, None] + after_s
    return instants[instants < following[:, None]]
