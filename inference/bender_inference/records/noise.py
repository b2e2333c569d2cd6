"""The noise floor of a residual, found from the residual itself.

Four estimates see different things. Third differences see what changes from row to row: smooth structure cancels,
ringing does not. The median of the periodogram sees what most frequencies hold: a hum or a resonance fills few of
them, a slow structure few as well. The quietest quarter of short stretches sees the residual while nothing happens. The
same quarter by the median of each one's periodogram sees it where a hum fills every stretch, and steps are missed that
fill every frequency of the whole. All err upwards when structure is left, so the smallest one is the floor.

A staircase of few rows a level leaves something after every step, in all of these. The rows at the end of each level
differ by noise alone: where they say clearly less, they are the floor.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv, ndtri

from bender_loop.records.outliers import deviation

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# the third difference of white noise has variance 1 + 9 + 9 + 1
_THIRD_DIFFERENCE = np.sqrt(20.0)
_STRETCH = 16
_FEWEST_STRETCHES = 24
# a parabola through each stretch takes three degrees of freedom
_FREE = _STRETCH - 3
# long enough for a hum to fill few of its frequencies
_SPECTRAL_STRETCH = 32
# so many say enough of a long record
_MOST_STRETCHES = 4096
QUIET_MEDIAN = 0.4942
"""Lower quartile of `quiet_medians` of white noise of deviation 1, from 400 000 draws."""
_QUIET = 0.25
_FEWEST_RESTING = 100
_DEVIATION_ERROR = 1.29
"""Over the root of so many differences of neighbours: the relative error of their deviation, from 4000 draws."""
_CLEARLY = 3.0
SAME_SIMULATION, ROUNDED = 1e-6, 1e-6
"""Of the span: what sub-steps of other lengths differ by. Of a digit: what a conversion of units leaves of rounding."""


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
    values = residual[usable]
    if np.count_nonzero(values) < (1.0 - _QUIET) * values.size:
        return float("nan")
    count = residual.size // _SPECTRAL_STRETCH
    whole = usable[: count * _SPECTRAL_STRETCH].reshape(count, _SPECTRAL_STRETCH).all(axis=1)
    kept = np.flatnonzero(whole)
    if kept.size < _FEWEST_STRETCHES:
        return float("nan")
    stretches = residual[: count * _SPECTRAL_STRETCH].reshape(count, _SPECTRAL_STRETCH)
    stretches = stretches[kept[:: 1 + kept.size // _MOST_STRETCHES]]
    return float(np.sqrt(np.quantile(quiet_medians(stretches), _QUIET) / QUIET_MEDIAN))


def end_of_rests(command: Array) -> Mask:
    """Return which rows (n,) follow another one in the second half of a stretch in which the command rests."""
    begins = np.concatenate([[True], command[1:] != command[:-1]])
    firsts: NDArray[np.intp] = np.flatnonzero(begins)
    lengths = np.diff(np.append(firsts, command.size))
    since = np.arange(command.size) - np.repeat(firsts, lengths)
    return since > np.repeat(lengths, lengths) // 2


def from_rests(residual: Array, usable: Mask, resting: Mask) -> tuple[float, float]:
    """Return the deviation of white noise that neighbours show while the command rests, and its relative error."""
    differences = np.diff(residual)[usable[1:] & usable[:-1] & resting[1:]]
    if differences.size < _FEWEST_RESTING:
        return float("nan"), float("nan")
    return deviation(differences) / math.sqrt(2.0), _DEVIATION_ERROR / math.sqrt(differences.size)


def quiet_medians(stretches: Array) -> Array:
    """Return the median of each stretch's periodogram, shape (stretches,), a straight line taken off each."""
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, _SPECTRAL_STRETCH), 2))
    window = np.hanning(_SPECTRAL_STRETCH)
    left = (stretches - (stretches @ basis) @ basis.T) * window
    power = np.abs(np.fft.rfft(left, axis=1)[:, 1:-1]) ** 2 / np.sum(window**2)
    return np.median(power, axis=1)


def interpolated(residual: Array, usable: Mask) -> Array:
    """Return the residual with straight lines across the rows that do not count."""
    rows = np.arange(residual.size)
    return np.interp(rows, rows[usable], residual[usable])


def noise_floor_um(residual: Array, usable: Mask, resting: Mask | None = None) -> float:
    """Return the noise floor of a residual, in its unit.

    Args:
        residual: (n,) of one record.
        usable: (n,) rows that count.
        resting: (n,) rows that differ from the one before by noise alone, as `end_of_rests` finds them.

    Raises:
        ValueError: fewer than 16 rows count.
    """
    ways = (from_differences, from_spectrum, from_stretches, from_quiet_spectra)
    estimates = [x for x in (way(residual, usable) for way in ways) if np.isfinite(x)]
    if not estimates:
        raise ValueError("found fewer than 16 rows with a reading, expected enough to estimate the noise")
    positive = [x for x in estimates if x > 0.0]
    floor = min(positive) if positive else 0.0
    if resting is None:
        return floor
    at_rest, error = from_rests(residual, usable, resting)
    return at_rest if 0.0 < at_rest < (1.0 - _CLEARLY * error) * floor else floor


def least_noise_um(readings_um: Array, *, steps: bool) -> float:
    """Return what no floor is below: the rounding of printed readings, and what simulations differ by.

    Args:
        readings_um: (n,) that count.
        steps: their last digit rounds them; False where steps of the sensor are counted elsewhere.
    """
    span = float(np.ptp(readings_um)) if readings_um.size else 0.0
    least = SAME_SIMULATION * span
    if not steps or span == 0.0:
        return least
    first, last = (-math.floor(math.log10(x)) for x in (span, least))
    for decimals in range(first, last + 1):
        off = np.abs(readings_um - np.round(readings_um, decimals))
        if np.all(off <= ROUNDED * 10.0**-decimals):
            return max(least, 10.0**-decimals / math.sqrt(12.0))
    return least


def by_chance_um2(noise_um: float, apart_um: Array, confidence: float) -> float:
    """Return by how much white noise sets the mean squared residuals of two equally good models apart, by chance.

    A paired test of equal accuracy (Diebold and Mariano 1995): where one model leaves e + d / 2 and the other
    e - d / 2, the difference is the mean of 2 e d, whose deviation is 2 σ |d| / n.

    Args:
        noise_um: σ, of the readings.
        apart_um: (n,) d, by which the readings of the two models differ.
        confidence: that chance makes no more of it, on this side.
    """
    if not apart_um.size:
        return 0.0
    return float(ndtri(confidence) * 2.0 * noise_um * np.linalg.norm(apart_um) / apart_um.size)


LOG_FLOOR_RATIO = {
    32: (0.2672, 0.2047), 45: (0.2192, 0.1526), 64: (0.1802, 0.0945), 91: (0.1603, 0.0682), 128: (0.1246, 0.0497),
    181: (0.1071, 0.0328), 256: (0.0936, 0.0240), 362: (0.0726, 0.0172), 512: (0.0763, 0.0101), 724: (0.0675, 0.0075),
    1024: (0.0786, 0.0060), 1448: (0.0650, 0.0045), 2048: (0.0534, 0.0029), 2896: (0.0455, 0.0020),
    4096: (0.0398, 0.0014),
}  # fmt: skip
"""Mean and variance of ln(variance / floor squared) of so many rows of white noise, from 2000 draws each."""


def floor_ratio_limit(rows: int, judged: int, error_rate: float) -> float:
    """Return how many times the square of its own floor the mean square of white noise is, but for an error rate.

    The floor is the smallest of four estimates, so it errs downwards, and more so on short records. Its logarithm is
    nearly normal: mean and variance are those of `LOG_FLOOR_RATIO`, the quantile is the normal distribution's.

    Args:
        rows: of the record that the floor is estimated from.
        judged: of them, rows in the mean square.
        error_rate: probability that noise exceeds what is returned.
    """
    sizes = np.array(list(LOG_FLOOR_RATIO))
    means, variances = np.array(list(LOG_FLOOR_RATIO.values())).T
    mean = float(np.interp(math.log(rows), np.log(sizes), means))
    variance = math.exp(float(np.interp(math.log(rows), np.log(sizes), np.log(variances))))
    # of the floor, smaller in longer records, and of the mean square itself
    variance = variance * sizes[-1] / max(rows, sizes[-1]) + 2.0 / judged
    return math.exp(mean + float(-ndtri(error_rate)) * math.sqrt(variance))
