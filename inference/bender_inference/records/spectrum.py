"""The spectrum of a residual over its instants, which of uneven rows shows frequencies far above their own."""

import math

import numpy as np
from scipy.fft import next_fast_len

from bender_inference.records.noise import Array, Mask

EVEN = 1e-3
FINEST_BIN_S = 2.5e-4
BINS_PER_STEP = 4.0
LINE_BINS_PER_STEP = 32.0
"""Where a line is looked for: of a camera's rows, up to some hundred hertz."""
LINE_BY_CHANCE = 0.01
"""Probability that the strongest line of white noise is taken for one that stands out."""


def are_even(time_s: Array) -> bool:
    """Return whether rows lie on a grid of equal steps, of which some may be missing."""
    steps = np.diff(time_s)
    rows = steps / float(np.median(steps))
    return bool(np.all(np.abs(rows - np.rint(rows)) < EVEN * np.rint(rows)))


def bin_s(time_s: Array) -> float:
    """Return the width of the bins that rows are gathered in: a step of even rows, fine beside those of uneven ones."""
    step = float(np.median(np.diff(time_s)))
    return step if are_even(time_s) else min(FINEST_BIN_S, step / BINS_PER_STEP)


def spectrum(time_s: Array, values: Array, width_s: float, padding: int = 4) -> tuple[Array, Array]:
    """Return frequencies in Hz and power of values that are gathered in bins, padded to some times their length."""
    bins = np.round((time_s - time_s[0]) / width_s).astype(int)
    line = np.bincount(bins, weights=values)
    padded: int = next_fast_len(padding * line.size, real=True)  # pyright: ignore[reportAssignmentType]
    frequencies = np.asarray(np.fft.rfftfreq(padded, width_s), dtype=np.float64)
    return frequencies, np.asarray(np.abs(np.fft.rfft(line, padded)) ** 2, dtype=np.float64)


def swing_columns(time_s: Array, frequency_Hz: float) -> Array:
    """Return sine and cosine of a frequency, and a constant, (n, 3)."""
    omega = 2.0 * np.pi * frequency_Hz
    return np.stack([np.sin(omega * time_s), np.cos(omega * time_s), np.ones_like(time_s)], axis=1)


def without_line(time_s: Array, residual: Array, usable: Mask) -> Array:
    """Return a residual without the strongest line of its spectrum, where rows are uneven and the line stands out.

    From row to row such a line looks like white noise: a hum of 100 Hz before a camera whose frames are some
    milliseconds early or late. The strongest of K powers of white noise is above ln(K / a) times their mean with
    probability a.
    """
    times, values = time_s[usable], residual[usable]
    if times.size < 16 or are_even(time_s):
        return residual
    values = values - values.mean()
    width_s = float(np.median(np.diff(time_s))) / LINE_BINS_PER_STEP
    frequencies, power = spectrum(times, values, width_s, 2)
    strongest = int(np.argmax(power))
    # of a padded spectrum every second frequency is one more
    count = power.size / 2.0
    if power[strongest] <= math.log(count / LINE_BY_CHANCE) * float(values @ values):
        return residual
    near = frequencies[strongest] + frequencies[1] * np.linspace(-0.5, 0.5, 11)
    columns = [swing_columns(times, float(x)) for x in near]
    left = [y - x @ np.linalg.lstsq(x, y)[0] for x, y in ((x, values) for x in columns)]
    kept = residual.copy()
    kept[usable] = min(left, key=lambda x: float(x @ x)) + residual[usable].mean()
    return kept
