"""The noise of a residual: autoregressive predictors of every order up to the one that Schwarz's criterion takes.

Durbin-Levinson recursion on the covariances of rows that count (Brockwell and Davis 1991, Time Series: Theory and
Methods, section 5.2). Behind a gap of m rows the predictor of order m is the exact one.
"""

import math

import numpy as np
from numpy.typing import NDArray

from bender_watch.sequential.detector import CLIP, Noise

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MOST_ORDER = 8
STABLE = 0.999
ROUNDS = 3
"""Of setting outlying rows aside and fitting again."""


def fit_noise(residual_um: Array, usable: Mask, spread: Array, least_um: float) -> tuple[Noise, Mask]:
    """Return the noise of a residual, and the rows that count.

    Args:
        residual_um: (n,) about zero.
        usable: (n,) rows with a reading.
        spread: (n,) factor on the deviation.
        least_um: deviation that the noise has at least.
    """
    kept = usable.copy()
    noise = Noise(np.zeros((1, 0)), np.array([max(least_um, _deviation(residual_um[kept] / spread[kept]))]))
    for _ in range(ROUNDS):
        noise = _levinson(residual_um / spread, kept, least_um)
        e = innovations(noise, residual_um, kept, spread)
        # what was set aside has no innovation, and stays aside
        further = kept & ~(np.abs(np.nan_to_num(e)) > CLIP + 0.5)
        if np.array_equal(further, kept):
            break
        kept = further
    return noise, kept


def innovations(noise: Noise, residual_um: Array, usable: Mask, spread: Array) -> Array:
    """Return the whitened residual (n,), NaN where a row does not count."""
    order = noise.coefficients.shape[1]
    rows = np.arange(residual_um.size)
    seen = np.minimum(rows - np.maximum.accumulate(np.where(usable, -1, rows)) - 1, order)
    expected = np.zeros(rows.size)
    for lag in range(1, order + 1):
        known = np.flatnonzero(usable & (seen >= lag))
        expected[known] += noise.coefficients[seen[known], lag - 1] * residual_um[known - lag]
    return np.where(usable, (residual_um - expected) / (noise.spreads_um[np.maximum(seen, 0)] * spread), np.nan)


def _levinson(values: Array, usable: Mask, least_um: float) -> Noise:
    count = int(usable.sum())
    covariance = _covariances(values, usable, min(MOST_ORDER, max(0, count // 20)))
    rows, variances = [np.zeros(MOST_ORDER)], [float(covariance[0])]
    best, least = 0, 0.0
    for m in range(1, covariance.size):
        before = rows[-1]
        if variances[-1] <= 0.0:
            break
        reflection = (covariance[m] - float(before[: m - 1] @ covariance[m - 1 : 0 : -1])) / variances[-1]
        if abs(reflection) > STABLE:
            break
        row = before.copy()
        row[m - 1] = reflection
        row[: m - 1] -= reflection * before[: m - 1][::-1]
        rows.append(row)
        variances.append(variances[-1] * (1.0 - reflection * reflection))
        criterion = count * math.log(variances[-1] / variances[0]) + m * math.log(count)
        if criterion < least:
            best, least = m, criterion
    spreads = np.maximum(np.sqrt(np.maximum(variances[: best + 1], 0.0)), least_um)
    return Noise(np.array(rows[: best + 1])[:, :best], spreads)


def _covariances(values: Array, usable: Mask, lags: int) -> Array:
    centred = np.where(usable, np.nan_to_num(values), 0.0)
    centred = np.where(usable, centred - centred[usable].mean(), 0.0)
    weights = usable.astype(float)
    found = []
    for lag in range(lags + 1):
        pairs = float(weights[lag:] @ weights[: weights.size - lag])
        found.append(float(centred[lag:] @ centred[: centred.size - lag]) / max(pairs, 1.0))
    return np.array(found)


def _deviation(values: Array) -> float:
    return float(1.4826 * np.median(np.abs(values - np.median(values)))) if values.size else 0.0


def doubt_of_variance(rows: int) -> float:
    """Return by which part of itself the variance of so many rows may be larger, or smaller, than it seems."""
    return 1.645 * math.sqrt(2.0 / rows)


def doubt_of_noise(noise: Noise, signatures_um: Array, rows: int, rng: np.random.Generator) -> Array:
    """Return by which factor (j,) the variance of each signature's score may be larger than it seems.

    The coefficients are known to `1 / rows` of their asymptotic covariance; under other ones within it, whitened noise
    is not quite white. The spectrum of each signature weighs what that does. One deviation and two thirds are allowed
    for, of this and of the estimate of the variance itself.

    Args:
        noise: as estimated.
        signatures_um: (n, j) on the training record.
        rows: that the noise was estimated from.
        rng: for the draws.
    """
    order, size = noise.coefficients.shape[1], signatures_um.shape[1]
    own = doubt_of_variance(rows)
    if order == 0 or size == 0:
        return np.full(size, 1.0 + own)
    a, variance = noise.coefficients[order], noise.spreads_um[order] ** 2
    length = 2048
    response = np.fft.rfft(np.concatenate([[1.0], -a]), length)
    autocovariance = np.fft.irfft(variance / np.abs(response) ** 2, length)[:order]
    toeplitz = autocovariance[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
    covariance = np.linalg.inv(toeplitz) * variance / rows
    power = np.abs(np.fft.rfft(signatures_um[: (len(signatures_um) // length or 1) * length], length, axis=0)) ** 2
    weights = power * (np.abs(response) ** 2)[:, None]
    weights /= np.maximum(weights.sum(axis=0), 1e-300)
    factors = []
    for draw in rng.multivariate_normal(a, covariance, 60):
        other = np.fft.rfft(np.concatenate([[1.0], -draw]), length)
        factors.append((np.abs(response) ** 2 / np.maximum(np.abs(other) ** 2, 1e-12)) @ weights)
    doubt = np.std(np.minimum(np.array(factors), 4.0), axis=0)
    return (1.0 + own) * (1.0 + 1.645 * doubt)
