"""Preisach's relays with a smooth density, exact for any path of the voltage at 0 V and above.

A relay with centre c and half-width r switches up at c + r and down at c - r. Between two extrema beta < alpha of the
voltage the output changes by twice the Everett function E, the weight of all relays with beta <= c - r and
c + r <= alpha; the extrema that count form a nested stack, from which smaller loops are wiped out (Mayergoyz,
Mathematical Models of Hysteresis and Their Applications, 2003, chapter 1). E is tabulated over half the distance and
the middle of the two extrema, so it vanishes exactly where they meet, and interpolated in between. The bench starts
demagnetised: relays with a centre above 0 are down.
"""

from typing import NamedTuple

import numpy as np
from bender_proving.physics.lobatto import Array
from numba import njit
from scipy.stats import cauchy, norm

REACH_V = 64.0
_STEP_V = 0.25
_DEPTH = 4096
_INSIDE = 1.0 - 1e-9


class Relays(NamedTuple):
    """Everett function and the curve from the demagnetised state.

    Attributes:
        everett: shape (m, m), over half the distance and the middle of two extrema, both from 0 to REACH_V.
        virgin: weight switched up when the voltage first rises from 0 to k * 0.25 V, shape (m,).
    """

    everett: Array
    virgin: Array


def relays(law: str, width_V: float, spread_V: float, centre_V: float, centre_spread_V: float) -> Relays:
    """Tables for a density that is the product of one in the half-width and one in the centre.

    Args:
        law: "gauss" or "lorentz", of both factors.
        width_V: most frequent half-width of a relay.
        spread_V: scale of the half-widths around it.
        centre_V: most frequent centre.
        centre_spread_V: scale of the centres around it.
    """
    shape = {"gauss": norm, "lorentz": cauchy}[law]
    count = round(REACH_V / _STEP_V) + 1
    weight = shape.pdf((np.arange(count) * _STEP_V - width_V) / spread_V)
    centres = np.arange(-2 * count, 2 * count + 1) * _STEP_V
    return Relays(*_tables(weight / weight.sum(), shape.cdf((centres - centre_V) / centre_spread_V)))


@njit(cache=True)
def _tables(weight: Array, below: Array) -> tuple[Array, Array]:
    """Sums of the density over triangles; `below` is the share of centres up to (k - middle index) * 0.25 V."""
    count, zero = len(weight), len(below) // 2
    everett = np.zeros((count, count))
    virgin = np.zeros(count)
    for i in range(1, count):
        for r in range(i + 1):
            share = 0.5 * weight[r] if r in (0, i) else weight[r]
            room = i - r
            virgin[i] += share * (below[zero + room] - below[zero])
            for c in range(count):
                everett[i, c] += share * (below[zero + c + room] - below[zero + c - room])
    return everett, virgin


@njit(cache=True)
def _between(row: Array, place: float) -> float:
    place = min(max(place, 0.0), (len(row) - 1) * _INSIDE)
    k = int(place)
    return row[k] + (place - k) * (row[k + 1] - row[k])


@njit(cache=True)
def _weight(everett: Array, upper: float, lower: float) -> float:
    half = min(0.5 * (upper - lower) / _STEP_V, (len(everett) - 1) * _INSIDE)
    middle = 0.5 * (upper + lower) / _STEP_V
    k = int(half)
    first = _between(everett[k], middle)
    return first + (half - k) * (_between(everett[k + 1], middle) - first)


@njit(cache=True)
def _output(everett: Array, virgin: Array, stack: Array, depth: int, v: float) -> float:
    before = stack[0] if depth > 0 else v
    total = _between(virgin, before / _STEP_V)
    for k in range(1, depth + 1):
        point = stack[k] if k < depth else v
        if point >= before:
            total += _weight(everett, point, before)
        else:
            total -= _weight(everett, before, point)
        before = point
    return 2.0 * total


@njit(cache=True)
def _wiped(stack: Array, depth: int, v: float) -> int:
    """Depth of the stack after the voltage came to v: pairs of extrema inside the range travelled are forgotten."""
    while depth > 1 and not min(stack[depth - 2], stack[depth - 1]) < v < max(stack[depth - 2], stack[depth - 1]):
        depth -= 2
    return depth


@njit(cache=True)
def respond(everett: Array, virgin: Array, path_V: Array) -> Array:
    """Output for a path of voltages >= 0, shape (n,), from the demagnetised state at 0 V; only its extrema count."""
    out = np.zeros(len(path_V))
    stack = np.empty(_DEPTH)
    depth, v, level, rising = 0, 0.0, 0.0, True
    for i in range(len(path_V)):
        target = path_V[i]
        if target != v:
            if (target > v) != rising:
                stack[depth] = v
                depth = min(depth + 1, _DEPTH - 1)
            rising = target > v
            depth = _wiped(stack, depth, target)
            v = target
            level = _output(everett, virgin, stack, depth, v)
        out[i] = level
    return out
