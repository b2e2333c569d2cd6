"""Other detectors on the same whitened residual: each a function of rows and a setting, run from alarm to alarm.

| name | what it is |
|---|---|
| moving window | the mean of the last 64 rows beyond a threshold |
| Page-Hinkley | the usual two-sided one, about the running mean, with an allowance of 0.05 (Page 1954) |
| ADWIN | a window that is cut where the means of its parts differ (Bifet and Gavalda 2007), parts at powers of two |
| Kalman innovations | the sum of the squares of the last 64 innovations beyond a threshold (Mehra and Peschon 1971) |

Settings are sought for which each raises as many false alarms as the watch on rows without a change.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Detector = Callable[[Array, float], int]
"""Returns the first row that alarms, -1 for none."""

WINDOW = 64
ALLOWANCE = 0.05
CHECKED_EVERY = 16
HALVINGS = 14


def moving_window(e: Array, threshold: float) -> int:
    """Mean of the last rows, in its own deviation."""
    sums = np.convolve(e, np.ones(WINDOW))[: e.size] / math.sqrt(WINDOW)
    return _first(np.abs(sums) > threshold, WINDOW)


def kalman_innovations(e: Array, threshold: float) -> int:
    """Sum of squares of the last rows, in its own deviation."""
    sums = (np.convolve(e**2, np.ones(WINDOW))[: e.size] - WINDOW) / math.sqrt(2.0 * WINDOW)
    return _first(sums > threshold, WINDOW)


def page_hinkley(e: Array, threshold: float) -> int:
    """Sum of what lies beyond the running mean and the allowance, over its lowest value so far; both ways."""
    mean = np.cumsum(e) / np.arange(1.0, e.size + 1.0)
    alarms = np.zeros(e.size, bool)
    for sign in (1.0, -1.0):
        total = np.cumsum(sign * (e - mean) - ALLOWANCE)
        alarms |= total - np.minimum.accumulate(total) > threshold
    return _first(alarms, 0)


def adwin(e: Array, threshold: float) -> int:
    """Difference of the means of two parts of all rows so far, in its own deviation."""
    sums = np.concatenate([[0.0], np.cumsum(e)])
    for end in range(2 * CHECKED_EVERY, e.size + 1, CHECKED_EVERY):
        later = CHECKED_EVERY * 2 ** np.arange(int(math.log2(end / CHECKED_EVERY)))
        later = later[later < end]
        early = end - later
        means = (sums[end] - sums[early]) / later - sums[early] / early
        if np.any(np.abs(means) / np.sqrt(1.0 / later + 1.0 / early) > threshold):
            return end - 1
    return -1


OTHERS: dict[str, Detector] = {
    "moving window": moving_window,
    "Page-Hinkley": page_hinkley,
    "ADWIN": adwin,
    "Kalman innovations": kalman_innovations,
}


def setting(detector: Detector, quiet: Array, rows: float) -> float:
    """Return the threshold at which a detector raises one alarm in so many rows of a residual without a change."""
    low, high = 0.5, 400.0
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if _count(detector, quiet, middle) > quiet.size / rows else (low, middle)
    return high


def _count(detector: Detector, e: Array, threshold: float) -> int:
    count, begin = 0, 0
    while begin < e.size:
        row = detector(e[begin:], threshold)
        if row < 0:
            break
        count, begin = count + 1, begin + row + 1
    return count


def _first(alarms: NDArray[np.bool_], begin: int) -> int:
    alarms = alarms.copy()
    alarms[:begin] = False
    return int(np.argmax(alarms)) if alarms.any() else -1
