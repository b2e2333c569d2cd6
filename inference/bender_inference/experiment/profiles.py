"""Voltage profiles that distinguish effects, as building blocks of a designed experiment.

All stay within the limits of the bench, start and end at 0 V, and are held from row to row.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


RAMP_CYCLES = 12.0
LEAST_ROWS_PER_CYCLE = 5.0
CAMERA_STEP_S = 1.0 / 30.0


@dataclass(frozen=True, slots=True)
class Limits:
    """What the bench allows: voltages, and how fast they may change (inf: as fast as the supply can)."""

    low_V: float = 0.0
    high_V: float = 50.0
    slew_V_per_s: float = float("inf")


def seen_limits(voltages_V: Sequence[Array], highest_V: float | None = None) -> Limits:
    """Return the limits of a next experiment: the voltages that the device has seen, 0 V among them.

    Args:
        voltages_V: of every record.
        highest_V: what the bench may be asked for instead of the highest voltage seen; None for that one.
    """
    low = min(0.0, *(float(np.min(x)) for x in voltages_V))
    high = max(0.0, *(float(np.max(x)) for x in voltages_V))
    return Limits(low, high if highest_V is None else highest_V)


def _held(levels: Array, dwell_s: float, step_s: float) -> Array:
    return np.repeat(levels, max(1, round(dwell_s / step_s)))


@dataclass(frozen=True, slots=True)
class Sine:
    """One frequency at one amplitude: what a record was driven with."""

    frequency_Hz: float
    middle_V: float
    amplitude_V: float


def ramp_and_frequencies(step_s: float, sine: Sine) -> Array:
    """The sine of a record with its amplitude growing from nothing, then three times slower and three times faster."""
    own = sine.frequency_Hz
    growing = np.arange(0.0, RAMP_CYCLES / own, step_s)
    parts = [growing / growing[-1] * np.sin(2.0 * np.pi * own * growing)]
    for frequency in (own / 3.0, 3.0 * own):
        if frequency * step_s < LEAST_ROWS_PER_CYCLE**-1:
            parts.append(np.sin(2.0 * np.pi * frequency * np.arange(0.0, RAMP_CYCLES / 2.0 / own, step_s)))
    return sine.middle_V + sine.amplitude_V * np.concatenate(parts)


def steps_and_holds(step_s: float, top: float) -> Array:
    """Steps of several sizes, both ways, with holds from a tenth of a second to half a minute."""
    short = _held(top * np.array([0.3, 0.0, 1.0, 0.0, 0.6, 0.2, 1.0, 0.5]), 0.5, step_s)
    long = [
        _held(np.array([x * top]), dwell, step_s) for x, dwell in ((1.0, 30.0), (0.0, 15.0), (0.5, 10.0), (0.0, 5.0))
    ]
    return np.concatenate([short, *long])


def amplitude_ladder(step_s: float, top: float) -> Array:
    """Sines about the middle, at three amplitudes and three frequencies a decade and more apart."""
    parts = []
    for frequency, cycles in ((0.1, 1.5), (0.7, 4.0), (4.0, 12.0)):
        for share in (1.0, 0.5, 0.25):
            time = np.arange(0.0, cycles / frequency, step_s)
            parts.append(top * (0.5 + 0.5 * share * np.sin(2.0 * np.pi * frequency * time)))
    return np.concatenate(parts)


def descending_triangles(step_s: float, top: float) -> Array:
    """Triangles that shrink from cycle to cycle, slow and fast: minor loops, remanence, dead zones."""
    parts = []
    for period in (8.0, 1.0):
        for share in (1.0, 0.8, 0.6, 0.4, 0.2):
            phase = np.arange(0.0, 1.0, step_s / period)
            parts.append(top * share * (1.0 - np.abs(2.0 * phase - 1.0)))
    return np.concatenate(parts)


def fine_staircase(step_s: float, top: float) -> Array:
    """Small steps up and down: dead zones, steps of the supply or the sensor, play."""
    levels = top * np.concatenate([np.linspace(0.0, 1.0, 51), np.linspace(1.0, 0.0, 51)])
    return _held(levels, 0.3, step_s)


def quick_steps(step_s: float, top: float) -> Array:
    """Large steps with time to ring and to settle: delays, lags, resonances."""
    levels = top * np.tile([0.2, 0.8, 0.3, 1.0, 0.0, 0.5], 8)
    return np.concatenate([_held(levels, 0.4, step_s), _held(levels[:12], 1.0, step_s)])


def random_levels(rng: np.random.Generator, step_s: float, top: float) -> Array:
    """Random levels with random dwell, from a few rows to several seconds."""
    dwell = np.exp(rng.uniform(np.log(0.1), np.log(6.0), 45))
    return np.concatenate(
        [_held(np.array([x]), d, step_s) for x, d in zip(rng.uniform(0.0, top, 45), dwell, strict=True)]
    )


PATTERNS: dict[str, Callable[[float, float], Array]] = {
    "steps and holds": steps_and_holds,
    "amplitude ladder": amplitude_ladder,
    "descending triangles": descending_triangles,
    "fine staircase": fine_staircase,
    "quick steps": quick_steps,
}


def within(voltage_V: Array, limits: Limits, step_s: float) -> Array:
    """Return a profile led from 0 V and back, clipped to the limits and to the slew rate."""
    wanted = np.clip(np.concatenate([[0.0], voltage_V, np.zeros(2)]), limits.low_V, limits.high_V)
    if not np.isfinite(limits.slew_V_per_s):
        return wanted
    most = limits.slew_V_per_s * step_s
    slewed = [float(wanted[0])]
    for value in wanted[1:]:
        slewed.append(float(np.clip(value, slewed[-1] - most, slewed[-1] + most)))
    while abs(slewed[-1]) > 1e-9:
        slewed.append(float(np.clip(0.0, slewed[-1] - most, slewed[-1] + most)))
    return np.array(slewed)
