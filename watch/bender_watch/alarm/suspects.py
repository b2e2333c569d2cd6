"""Which signatures explain a change, compared as a diagnosis compares effects: with level and gain free beside each.

The signature of an effect is that of a small change of its own form. A change of another form has a part of level and
gain beside it, and is larger than small: what a signature leaves is not noise alone. So each is fitted together with
level and gain, rows far from the fit are set aside, and the scale of the log-likelihood is what the best one leaves.
What is far larger than the noise keeps its shape, which it would lose under a clip of the innovations.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bender_watch.alarm.onset import Onset
from bender_watch.sequential.detector import CLIP

Array = NDArray[np.float64]

BESIDE = 2
"""Signatures that are free beside every other one: level and gain."""
ROUNDS = 8
"""Of setting rows aside and fitting again."""
RIDGE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """One signature with level and gain beside it: what it leaves (n,), its amplitude, and since when it is there."""

    left: Array
    amplitude: float
    std: float
    onset: Onset


def compared(
    innovations: Array, whitened: Array, onsets: Sequence[Onset], grows_only: NDArray[np.bool_] | None = None
) -> tuple[Array, list[Onset]]:
    """Return the log-likelihood ratio (j,) of each signature with level and gain beside it, less the price of both.

    A change begins at one row, whatever it is: each signature is tried at its own likeliest row and at the likeliest of
    all of them; the onsets that are returned are the better ones.

    Args:
        innovations: (n,) of the rows that count.
        whitened: (n, j) signatures, level and gain first.
        onsets: (j,) when the change began along each.
        grows_only: (j,) of which a negative amplitude is no change that there can be.
    """
    only = np.zeros(len(onsets), bool) if grows_only is None else grows_only
    leading = onsets[int(np.argmax([x.log_likelihood for x in onsets]))]
    fits = [
        min((_fit(innovations, whitened, j, x, bool(only[j])) for x in (own, leading)), key=lambda x: _size(x.left))
        for j, own in enumerate(onsets)
    ]
    scale = min(_scale(x.left) for x in fits)
    none = _bounded(innovations / scale)
    price = 0.5 * math.log(max(innovations.size, 2))
    numbers = np.where(np.arange(len(onsets)) < BESIDE, 1, 1 + BESIDE)
    likelihood = np.array([none - _bounded(x.left / scale) for x in fits]) - price * numbers
    moved = [
        own if x.onset is own else replace(leading, amplitude=x.amplitude, std=x.std)
        for own, x in zip(onsets, fits, strict=True)
    ]
    return likelihood, moved


def _fit(e: Array, z: Array, place: int, onset: Onset, grows_only: bool) -> _Fit:
    """Return the fit of one signature from the beginning of a change on."""
    columns = [place] if place < BESIDE else [place, *range(BESIDE)]
    own = z[:, columns] * onset.weights(e.size)[:, None]
    fits = [_fitted(e, own, start) for start in (e, np.clip(e, -CLIP, CLIP))]
    left, best = min(((e - own @ x, x) for x in fits), key=lambda x: _size(x[0]))
    if grows_only and best[0] < 0.0:
        beside = own[:, 1:]
        return _Fit(e - beside @ _fitted(e, beside, e), 0.0, math.inf, onset)
    return _Fit(left, float(best[0]), _scale(left) * math.sqrt(float(np.linalg.inv(_normal(own))[0, 0])), onset)


def _fitted(e: Array, own: Array, start: Array) -> Array:
    """Return the amplitudes, fitted without the rows whose residual is beyond the clip."""
    found = _least_squares(own, start)
    for _ in range(ROUNDS):
        left = e - own @ found
        near = np.abs(left) <= CLIP * _scale(left)
        if near.sum() <= own.shape[1]:
            break
        further = _least_squares(own[near], e[near])
        if np.array_equal(further, found):
            break
        found = further
    return found


def _least_squares(own: Array, e: Array) -> Array:
    return np.linalg.solve(_normal(own), own.T @ e).astype(np.float64)


def _normal(own: Array) -> Array:
    normal = own.T @ own
    return normal + np.diag(RIDGE * np.maximum(np.diag(normal), 1e-300) + 1e-12)


def _scale(left: Array) -> float:
    """Return the standard deviation of the residual, at least that of the noise."""
    return max(1.0, 1.4826 * float(np.median(np.abs(left))))


def _bounded(values: Array) -> float:
    return 0.5 * float(np.sum(np.minimum(values * values, CLIP * CLIP)))


def _size(left: Array) -> float:
    return _bounded(left / _scale(left)) + left.size * math.log(_scale(left))
