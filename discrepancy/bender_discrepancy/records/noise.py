"""The noise floor of a residual, found from the residual itself.

Four estimates see different things. Third differences see what changes from row to row: smooth structure cancels,
ringing does not. The median of the periodogram sees what most frequencies hold: a hum or a resonance fills few of
them, a slow structure few as well. The quietest quarter of short stretches sees the residual while nothing happens. The
same quarter by the median of each one's periodogram sees it where a hum fills every stretch, and steps are missed that
fill every frequency of the whole. All err upwards when structure is left, so the smallest one is the floor.
"""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv, ndtri

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# the third difference of white noise has variance 1 + 9 + 9 + 1
_THIRD_DIFFERENCE = np.sqrt(20.0)
_MAD_TO_DEVIATION = 1.4826
_STRETCH = 16
_FEWEST_STRETCHES = 24
# a parabola through each stretch takes three degrees of freedom
_FREE = _STRETCH - 3
# long enough for a hum to fill few of its frequencies
_SPECTRAL_STRETCH = 32
_QUIET = 0.25


def deviation(values: Array) -> float:
    """Return the standard deviation of the bulk of the values (median absolute deviation)."""
    return float(_MAD_TO_DEVIATION * np.median(np.abs(values - np.median(values)))) if values.size else 0.0


def from_differences(residual: Array, usable: Mask) -> float:
    """Return the deviation of white noise that third differences show."""
    runs = usable[3:] & usable[2:-1] & usable[1:-2] & usable[:-3]
    differences = np.diff(residual, 3)[runs]
    return deviation(differences) / float(_THIRD_DIFFERENCE) if differences.size >= 10 else float("nan")


def from_spectrum(residual: Array, usable: Mask) -> float:
    """Return the deviation of white noise that the median of the periodogram shows (an exponential's is ln 2)."""
    # closed up over lost rows: what is put in their place would have no noise
    values = residual[usable]
    count = values.size
    if count < 16:
        return float("nan")
    window = np.hanning(count)
    power = np.abs(np.fft.rfft((values - values.mean()) * window)[1:-1]) ** 2 / np.sum(window**2)
    return float(np.sqrt(np.median(power) / np.log(2.0)))


def from_stretches(residual: Array, usable: Mask) -> float:
    """Return the deviation of white noise that the quietest quarter of short stretches shows, each about a parabola."""
    count = residual.size // _STRETCH
    whole = usable[: count * _STRETCH].reshape(count, _STRETCH).all(axis=1)
    stretches = residual[: count * _STRETCH].reshape(count, _STRETCH)[whole]
    if len(stretches) < _FEWEST_STRETCHES:
        return float("nan")
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, _STRETCH), 3))
    left = stretches - (stretches @ basis) @ basis.T
    variances = np.sum(left**2, axis=1) / _FREE
    return float(np.sqrt(np.quantile(variances, _QUIET) / (2.0 * gammaincinv(_FREE / 2.0, _QUIET) / _FREE)))


def from_quiet_spectra(residual: Array, usable: Mask) -> float:
    """Return the deviation of white noise that the periodograms of the quietest quarter of stretches show.

    Coarse readings that stand still leave nothing beyond their steps: that is not what is sought here.
    """
    if np.mean(residual[usable] == 0.0) > _QUIET:
        return float("nan")
    count = residual.size // _SPECTRAL_STRETCH
    whole = usable[: count * _SPECTRAL_STRETCH].reshape(count, _SPECTRAL_STRETCH).all(axis=1)
    stretches = residual[: count * _SPECTRAL_STRETCH].reshape(count, _SPECTRAL_STRETCH)[whole]
    if len(stretches) < _FEWEST_STRETCHES:
        return float("nan")
    return float(np.sqrt(np.quantile(_medians(stretches), _QUIET) / _quiet_median()))


def _medians(stretches: Array) -> Array:
    """Return the median of each stretch's periodogram, shape (stretches,), a straight line taken off each."""
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, _SPECTRAL_STRETCH), 2))
    window = np.hanning(_SPECTRAL_STRETCH)
    left = (stretches - (stretches @ basis) @ basis.T) * window
    power = np.abs(np.fft.rfft(left, axis=1)[:, 1:-1]) ** 2 / np.sum(window**2)
    return np.median(power, axis=1)


@cache
def _quiet_median() -> float:
    """Return the lower quartile of the medians of white noise of deviation 1, from draws."""
    draws = np.random.default_rng(0).standard_normal((20_000, _SPECTRAL_STRETCH))
    return float(np.quantile(_medians(draws), _QUIET))


def interpolated(residual: Array, usable: Mask) -> Array:
    """Return the residual with straight lines across the rows that do not count."""
    rows = np.arange(residual.size)
    return np.interp(rows, rows[usable], residual[usable])


def noise_floor_um(residual: Array, usable: Mask) -> float:
    """Return the noise floor of a residual, in its unit.

    Raises:
        ValueError: fewer than 16 rows count.
    """
    ways = (from_differences, from_spectrum, from_stretches, from_quiet_spectra)
    estimates = [x for x in (way(residual, usable) for way in ways) if np.isfinite(x)]
    if not estimates:
        raise ValueError("found fewer than 16 rows with a reading, expected enough to estimate the noise")
    positive = [x for x in estimates if x > 0.0]
    return min(positive) if positive else 0.0


_MOST_ROWS_DRAWN = 4096
_DRAWS = 200


def floor_ratio_limit(rows: int, judged: int, error_rate: float) -> float:
    """Return how many times the square of its own floor the mean square of white noise is, but for an error rate.

    The floor is the smallest of four estimates, so it errs downwards, and more so on short records. Its logarithm is
    nearly normal: mean and deviation come from draws, the quantile from the normal distribution.

    Args:
        rows: of the record that the floor is estimated from.
        judged: of them, rows in the mean square.
        error_rate: probability that noise exceeds what is returned.
    """
    size = max(32, min(rows, _MOST_ROWS_DRAWN))
    # the next half octave: few sizes are drawn
    size = round(2.0 ** (math.floor(2.0 * math.log2(size)) / 2.0))
    mean, variance = _log_floor_ratio(size)
    # of the floor, smaller in longer records, and of the mean square itself
    variance = variance * size / max(rows, size) + 2.0 / judged
    return math.exp(mean + float(-ndtri(error_rate)) * math.sqrt(variance))


@cache
def _log_floor_ratio(size: int) -> tuple[float, float]:
    """Return mean and variance of ln(variance / floor squared) of white noise."""
    rng = np.random.default_rng(size)
    usable = np.ones(size, dtype=np.bool_)
    logs = [-2.0 * math.log(noise_floor_um(rng.standard_normal(size), usable)) for _ in range(_DRAWS)]
    return float(np.mean(logs)), float(np.var(logs))
