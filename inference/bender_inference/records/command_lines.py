"""The lines of a command that is a sum of a few sines: what a device answers lies there and at their overtones."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bender_inference.records.excitation import one_sine, sine_frequency_Hz

Array = NDArray[np.float64]

MOST_LINES = 4
LEFT = 0.03
"""Of the changing part of the command, in variance: what a few sines leave of no other command of many rows."""
IN_BANDS, BAND = 0.85, 3
"""Share of that variance in bands of so many lines to either side of the strongest ones, before it is looked at."""
FEWEST_ROWS, MOST_ROWS = 64, 600
"""Of more, means of some rows in turn are looked at, as long as they hold what changes."""
PADDING = 4


def command_lines_Hz(time_s: Array, voltage_V: Array) -> tuple[float, ...]:
    """Return the frequencies of a command that is a sum of a few sines; none of any other one.

    Args:
        time_s: (n,) instants from which the commands act.
        voltage_V: (n,) commands.
    """
    if one_sine(time_s, voltage_V):
        return (sine_frequency_Hz(time_s, voltage_V),)
    return _lines(np.ascontiguousarray(time_s).tobytes(), np.ascontiguousarray(voltage_V).tobytes())


@lru_cache(maxsize=16)
def _lines(times: bytes, volts: bytes) -> tuple[float, ...]:
    time_s, voltage_V = np.frombuffer(times), np.frombuffer(volts)
    whole = float(np.var(voltage_V))
    if time_s.size < FEWEST_ROWS or whole == 0.0:
        return ()
    time_s, voltage_V = (_in_means(x - x[0]) for x in (time_s, voltage_V))
    if np.var(voltage_V) < (1.0 - LEFT) * whole or not _is_in_bands(time_s, voltage_V):
        return ()
    time_s, changing = time_s - time_s[0], voltage_V - voltage_V.mean()
    whole = float(changing @ changing)
    lines: list[float] = []
    left, columns = changing, np.empty((time_s.size, 0))
    for _ in range(MOST_LINES):
        lines = _refined([*lines, _strongest_Hz(time_s, left)], time_s, changing)
        columns = _columns(lines, time_s)
        weights, *_ = np.linalg.lstsq(columns, changing, rcond=None)
        left = changing - columns @ weights
        if float(left @ left) < LEFT * whole:
            return tuple(lines)
    return ()


def _in_means(values: Array) -> Array:
    """Return means of as many rows in turn as leave few enough."""
    each = -(-values.size // MOST_ROWS)
    return values[: values.size // each * each].reshape(-1, each).mean(axis=1)


def _is_in_bands(time_s: Array, voltage_V: Array) -> bool:
    """Return whether most of what changes lies about a few lines."""
    grid = np.linspace(time_s[0], time_s[-1], time_s.size)
    even = np.interp(grid, time_s, voltage_V)
    power = np.abs(np.fft.rfft((even - even.mean()) * np.hanning(even.size))) ** 2
    whole = float(power.sum())
    for _ in range(MOST_LINES):
        strongest = int(np.argmax(power))
        power[max(strongest - BAND, 0) : strongest + BAND + 1] = 0.0
    return float(power.sum()) < (1.0 - IN_BANDS) * whole


def _strongest_Hz(time_s: Array, values: Array) -> float:
    grid = np.linspace(0.0, float(time_s[-1]), time_s.size)
    even = np.interp(grid, time_s, values) * np.hanning(time_s.size)
    power = np.abs(np.fft.rfft(even, PADDING * even.size))
    return float(np.fft.rfftfreq(PADDING * even.size, grid[1])[1 + int(np.argmax(power[1:]))])


def _refined(lines: list[float], time_s: Array, values: Array) -> list[float]:
    """Return frequencies at which sines leave least, each within one line of where it was."""
    apart = 1.0 / float(time_s[-1])

    def left(at: Array) -> Array:
        columns = _columns(list(at), time_s)
        weights, *_ = np.linalg.lstsq(columns, values, rcond=None)
        return values - columns @ weights

    at = np.maximum(np.array(lines), 0.1 * apart)
    found = least_squares(
        left, at, bounds=(np.maximum(at - apart, 0.05 * apart), at + apart), x_scale=apart, max_nfev=6
    )
    return [float(x) for x in found.x]


def _columns(lines: list[float], time_s: Array) -> Array:
    """Return a constant, and sine and cosine of each frequency at an amplitude that may grow evenly."""
    phase = 2.0 * np.pi * np.outer(time_s, lines)
    waves = np.concatenate([np.sin(phase), np.cos(phase)], axis=1)
    return np.concatenate([np.ones((time_s.size, 1)), waves, waves * (time_s / time_s[-1])[:, None]], axis=1)
