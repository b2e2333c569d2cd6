"""From a mean time between false alarms to thresholds: how long each test runs while nothing has changed.

CUSUM (Page 1954): the run length of `S = max(0, S + x - k)` until `S >= h` by Siegmund's corrected diffusion
approximation (Siegmund 1985, Sequential Analysis, section 2.6) for normal increments, and by a Markov chain on cells
of S (Brook and Evans, Biometrika 59, 1972) for increments of any distribution.

GLR over all windows of a signature (Siegmund and Venkatraman, Annals of Statistics 23, 1995, theorem 1): the time until
the square root of twice the log-likelihood ratio exceeds b,

    E T ~ sqrt(2 pi) exp(b^2 / 2) / (b int_0^b x nu(x)^2 dx).

Fewer windows than all exceed b no more often, so the time is a lower bound where windows are sparse. Another one is the
union of all windows that are looked at: of w windows that end at a row, 1 / (2 w Phi(-b)).
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri
from threadpoolctl import threadpool_limits

Array = NDArray[np.float64]
Distribution = Callable[[Array], Array]

OVERSHOOT = 0.5826
"""Mean excess of a normal random walk over a high boundary: -zeta(1/2) / sqrt(2 pi)."""
CELLS = 80
MOST_THRESHOLD = 1e4


def siegmund_run_length(reference: float, threshold: float) -> float:
    """Return the mean run length of a one-sided CUSUM of standard normal rows with reference value k > 0."""
    b = 2.0 * reference * (threshold + 2.0 * OVERSHOOT)
    return (math.exp(b) - b - 1.0) / (2.0 * reference * reference) if b < 700.0 else math.inf


def markov_run_length(distribution: Distribution, reference: float, threshold: float) -> float:
    """Return the mean run length of a one-sided CUSUM by a Markov chain on cells of its sum.

    Args:
        distribution: P(x <= value) of one row, of arrays.
        reference: k.
        threshold: h.
    """
    width = 2.0 * threshold / (2.0 * CELLS - 1.0)
    # cell 0 holds the sum at 0, cell i the sums around i w
    step = (np.arange(CELLS)[None, :] - np.arange(CELLS)[:, None] + 0.5) * width + reference
    below = distribution(step.astype(np.float64))
    moves = np.concatenate([below[:, :1], np.diff(below, axis=1)], axis=1)
    try:
        lengths = np.linalg.solve(np.eye(CELLS) - moves, np.ones(CELLS))
    except np.linalg.LinAlgError:
        return math.inf
    return float(lengths[0]) if lengths[0] > 0.0 else math.inf


def cusum_threshold(run_length: float, reference: float, distribution: Distribution | None = None) -> float:
    """Return the threshold at which a one-sided CUSUM runs for so many rows.

    Args:
        run_length: mean rows between false alarms.
        reference: k.
        distribution: of one row; None for a standard normal one.
    """
    if distribution is None:
        return _root(lambda h: siegmund_run_length(reference, h), run_length)
    # of small matrices: threads that wait for a core take many times as long as the work
    with threadpool_limits(limits=1):
        return _root(lambda h: markov_run_length(distribution, reference, h), run_length)


def _root(length: Callable[[float], float], wanted: float) -> float:
    low, high = 1e-3, 1.0
    while length(high) < wanted and high < MOST_THRESHOLD:
        low, high = high, 2.0 * high
    wanted_log = math.log(wanted)
    return float(brentq(lambda h: math.log(min(length(h), 1e300)) - wanted_log, low, high, xtol=1e-2))  # pyright: ignore[reportArgumentType]


def glr_run_length(threshold: float) -> float:
    """Return the mean run length of the GLR of one signature over all windows, until sqrt(2 log LR) exceeds b."""
    area = quad(lambda x: x * _nu(x) ** 2, 0.0, threshold)[0]
    return math.sqrt(2.0 * math.pi) * math.exp(0.5 * threshold * threshold) / (threshold * area)


def glr_threshold(run_length: float, windows: float) -> float:
    """Return the b at which the GLR of one signature runs for so many rows at least, by the sharper of two bounds.

    Args:
        run_length: mean rows between false alarms.
        windows: that end at a row, in the mean.

    Raises:
        ValueError: a run length below 10 rows.
    """
    if run_length < 10.0:
        raise ValueError(f"run_length: found {run_length:g}, expected at least 10 rows")
    wanted = math.log(run_length)
    of_union = float(-ndtri(0.5 / (windows * run_length)))
    of_all = float(brentq(lambda b: math.log(glr_run_length(b)) - wanted, 1.5, 30.0, xtol=1e-4))  # pyright: ignore[reportArgumentType]
    return min(of_all, of_union)


def _nu(x: float) -> float:
    """Return Siegmund's overshoot function, by the approximation of Siegmund and Yakir (2007)."""
    if x < 1e-6:
        return 1.0
    half = 0.5 * x
    density = math.exp(-0.5 * half * half) / math.sqrt(2.0 * math.pi)
    return (2.0 / x) * (float(ndtr(half)) - 0.5) / (half * float(ndtr(half)) + density)


def clipped_normal(clip: float) -> Distribution:
    """Return the distribution of a standard normal row that is clipped at ±clip."""

    def distribution(value: Array) -> Array:
        return np.where(value >= clip, 1.0, np.where(value < -clip, 0.0, ndtr(value)))

    return distribution


def clipped_square(clip: float, sign: float = 1.0, variance: float = 1.0) -> Distribution:
    """Return the distribution of sign times the square of a normal row of a variance that is clipped at ±clip."""
    most = clip * clip

    def square(value: Array) -> Array:
        inside = 2.0 * ndtr(np.sqrt(np.clip(value, 0.0, most) / variance)) - 1.0
        return np.where(value < 0.0, 0.0, np.where(value >= most, 1.0, inside))

    def distribution(value: Array) -> Array:
        return square(value) if sign > 0.0 else 1.0 - square(-value)

    return distribution
