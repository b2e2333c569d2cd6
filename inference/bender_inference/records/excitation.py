"""What a record excites: whether the command could distinguish effects with a memory at all."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

Array = NDArray[np.float64]

# the share of the command's changing part that one line of the spectrum must hold to be called a single sine
ONE_LINE = 0.95
AMPLITUDE_SPREAD = 0.05
FADED = 0.1
"""Of a record, at both ends together, where the band of its command is read off: a sweep begins there."""
BELOW_THE_BAND = 1e-3
"""The share of a command's energy that may lie below its band: a burst of fewer than some hundred periods has more."""


def changes_V(voltage_V: Array) -> Array:
    """Return the changes of the command that are not zero, the first one from 0 V."""
    steps = np.diff(voltage_V, prepend=0.0)
    return steps[np.abs(steps) > 1e-9 * max(1.0, float(np.max(np.abs(voltage_V), initial=0.0)))]


def one_sine(time_s: Array, voltage_V: Array) -> bool:
    """Return whether the command is one frequency at one amplitude (after its first tenth)."""
    begin = voltage_V.size // 10
    t, v = time_s[begin:] - time_s[begin], voltage_V[begin:] - voltage_V[begin:].mean()
    power = float(v @ v)
    if v.size < 16 or power == 0.0:
        return False
    grid = np.linspace(0.0, float(t[-1]), v.size)
    spectrum = np.abs(np.fft.rfft(np.interp(grid, t, v) * np.hanning(v.size))) ** 2
    peak = int(np.argmax(spectrum[1:])) + 1
    line = float(spectrum[max(peak - 2, 1) : peak + 3].sum())
    return line > ONE_LINE * float(spectrum[1:].sum()) and peak >= 3 and _steady(v)


def sine_frequency_Hz(time_s: Array, voltage_V: Array) -> float:
    """Return the frequency of the sine that fits a command best."""
    grid = np.linspace(time_s[0], time_s[-1], time_s.size)
    v = voltage_V - voltage_V.mean()
    spectrum = np.abs(np.fft.rfft(np.interp(grid, time_s, v) * np.hanning(v.size)))
    line = 1.0 / float(time_s[-1] - time_s[0])
    peak = line * (1 + int(np.argmax(spectrum[1:])))

    def left(frequency_Hz: float) -> float:
        phase = 2.0 * math.pi * frequency_Hz * time_s
        columns = np.stack([np.sin(phase), np.cos(phase), np.ones_like(phase)], axis=1)
        weights, *_ = np.linalg.lstsq(columns, v, rcond=None)
        return float(np.sum((v - columns @ weights) ** 2))

    around = (max(peak - line, 0.1 * line), peak + line)
    found: Any = minimize_scalar(left, bounds=around, method="bounded", options={"xatol": 1e-7 * line})
    return float(found.x)


def lowest_Hz(time_s: Array, voltage_V: Array, before_V: float | None = None) -> float:
    """Return where the band of a command begins, in Hz; 0 where nothing changes or hardly any row is there.

    What begins from rest steps to its first command: in a short record that step, the onset of a burst, is most of what
    places the record in time.

    Args:
        time_s: (n,) instants from which the commands act.
        voltage_V: (n,) commands.
        before_V: what was commanded until then, for as long as the record lasts; None for a record begun in motion.
    """
    whole = voltage_V if before_V is None else np.append(before_V, voltage_V)
    if voltage_V.size < 16 or np.ptp(whole) == 0.0:
        return 0.0
    grid = np.linspace(time_s[0], time_s[-1], voltage_V.size)
    even = np.interp(grid, time_s, voltage_V)
    if before_V is not None:
        even = np.concatenate([np.full_like(even, before_V), even])
    # its ends are none of the record's doing; an onset is in the middle of the window
    faded = np.ones(even.size)
    end = round(0.5 * FADED * even.size)
    faded[:end] = np.hanning(2 * end)[:end]
    faded[even.size - end :] = np.hanning(2 * end)[end:]
    power = np.abs(np.fft.rfft((even - np.average(even, weights=faded)) * faded)) ** 2
    below = np.cumsum(power) / power.sum()
    return float(np.fft.rfftfreq(even.size, grid[1] - grid[0])[np.searchsorted(below, BELOW_THE_BAND)])


def _steady(v: Array) -> bool:
    """Return whether the swing is as large in each quarter of the record."""
    swings = [float(np.ptp(part)) for part in np.array_split(v, 4)]
    return max(swings) - min(swings) < AMPLITUDE_SPREAD * max(swings) + 0.02 * max(swings)


def describe(time_s: Array, voltage_V: Array, *, untimed: bool = False) -> str:
    """Return the excitation in words, for the report."""
    if one_sine(time_s, voltage_V):
        return "one sine of one amplitude"
    steps = changes_V(voltage_V)
    if steps.size <= 2:
        return f"{steps.size} step{'s' * (steps.size != 1)}"
    levels = f"{np.unique(np.round(voltage_V, 3)).size} levels"
    return levels if untimed else f"{levels} in {time_s[-1] - time_s[0]:.3g} s"
