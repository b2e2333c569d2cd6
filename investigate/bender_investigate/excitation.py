"""Voltage profiles for a bench: rest and probe, a first excitation, another one.

All start and end at 0 V and keep to the voltage, the slew and the rows of the bench. A camera at some tens of frames
per second gets staircases, holds over several decades of time, sines, minor loops and random levels; a sensor that is
faster than the first resonance gets steps and a sweep.
"""

import numpy as np
from numpy.typing import NDArray

from bender_hil.runner.voltages import Voltages
from bender_inference.experiment.profiles import Limits, within
from bender_investigate.safety import Allowed, of_rows

Array = NDArray[np.float64]

REST_S, PROBE_S = 3.0, 2.5
PROBE_SHARES = (0.02, 0.05, 0.1, 0.2)
"""Of the highest voltage, one after the other: what the probe meets ends it while little is at stake."""
FAST_HZ = 300.0
"""From here on a sensor sees the ringing of the tip."""
FAST_S = 4.0
NOISES = 20.0
"""A small step moves the tip by so many deviations of the noise, at least."""
_TAIL_S = 3.0
_HOLDS = ((1.0, 0.16), (0.0, 0.07), (0.6, 0.035), (0.2, 0.018), (0.9, 0.009), (0.4, 0.005), (1.0, 0.003))
"""Share of the top, and of the time of the excitation."""


def rest_and_probe(allowed: Allowed) -> Voltages:
    """Return a rest at 0 V, then small holds, each higher than the one before."""
    is_fast = allowed.rate_Hz >= FAST_HZ
    rest_s, hold_s = (0.5, 0.2) if is_fast else (REST_S, PROBE_S)
    top_V = allowed.high_V
    parts = [np.zeros(_count(rest_s, allowed)), *(np.full(_count(hold_s, allowed), x * top_V) for x in PROBE_SHARES)]
    return _profile(np.concatenate([*parts, np.zeros(_count(hold_s, allowed))]), allowed, top_V)


def up_and_down(allowed: Allowed, top_V: float) -> Voltages:
    """Return the hardest that an excitation can be: the whole way up and down as fast as the slew allows."""
    hold = _count(1.0 if allowed.rate_Hz < FAST_HZ else 0.1, allowed)
    return _profile(np.concatenate([np.full(hold, top_V), np.zeros(hold)]), allowed, top_V)


def first_excitation(
    allowed: Allowed, top_V: float, small_V: float, duration_s: float, rng: np.random.Generator
) -> Voltages:
    """Return the excitation that shows most effects of the catalogue.

    Args:
        allowed: by the bench.
        top_V: highest voltage.
        small_V: of the smallest steps: they move the tip clearly beyond the noise.
        duration_s: of all of it, at most.
        rng: for the random levels.
    """
    if allowed.rate_Hz >= FAST_HZ:
        return _profile(_fast(allowed, top_V, min(duration_s, FAST_S), rng, falling=False), allowed, top_V)
    share = duration_s - _TAIL_S
    parts = [
        _staircase(top_V, 0.13 * share, allowed),
        *(_held([x * top_V], y * share, allowed) for x, y in _HOLDS),
        _sines(top_V, 0.2 * share, allowed),
        _minor_loops(top_V, 0.13 * share, allowed),
        _small_steps(top_V, small_V, 0.08 * share, allowed),
        _random_levels(top_V, 0.15 * share, allowed, rng),
        np.zeros(_count(_TAIL_S, allowed)),
    ]
    return _profile(np.concatenate(parts), allowed, top_V)


def another_excitation(allowed: Allowed, top_V: float, duration_s: float, rng: np.random.Generator) -> Voltages:
    """Return a different rich excitation: two tones, shrinking triangles, long and random holds."""
    if allowed.rate_Hz >= FAST_HZ:
        return _profile(_fast(allowed, top_V, min(duration_s, FAST_S), rng, falling=True), allowed, top_V)
    share = duration_s - _TAIL_S
    tones_s = 0.25 * share
    times = np.arange(_count(tones_s, allowed)) * allowed.step_s
    slow_Hz, fast_Hz = 0.11, 1.3
    tones = (
        0.5 * top_V * (1.0 - 0.7 * np.cos(2.0 * np.pi * slow_Hz * times) - 0.25 * np.cos(2 * np.pi * fast_Hz * times))
    )
    parts = [
        tones,
        _held([0.0, 0.85 * top_V], 0.15 * share, allowed),
        _minor_loops(top_V, 0.25 * share, allowed),
        _random_levels(top_V, 0.35 * share, allowed, rng),
        np.zeros(_count(_TAIL_S, allowed)),
    ]
    return _profile(np.concatenate(parts), allowed, top_V)


def _profile(levels_V: Array, allowed: Allowed, top_V: float) -> Voltages:
    limits = Limits(max(0.0, allowed.low_V), min(top_V, allowed.high_V), allowed.profile_slew_V_per_s)
    return of_rows(within(levels_V, limits, allowed.step_s), allowed.rate_Hz)


def _count(duration_s: float, allowed: Allowed) -> int:
    return max(1, round(duration_s * allowed.rate_Hz))


def _held(levels_V: list[float] | Array, duration_s: float, allowed: Allowed) -> Array:
    return np.repeat(np.asarray(levels_V, dtype=np.float64), _count(duration_s / len(levels_V), allowed))


def _staircase(top_V: float, duration_s: float, allowed: Allowed) -> Array:
    up = top_V * np.linspace(0.0, 1.0, 12)
    return _held(np.concatenate([up, up[-2::-1]]), duration_s, allowed)


def _sines(top_V: float, duration_s: float, allowed: Allowed) -> Array:
    parts = []
    for frequency_Hz, part, low, high in (
        (0.2, 0.4, 0.0, 1.0),
        (0.7, 0.25, 0.25, 0.95),
        (1.9, 0.2, 0.1, 0.6),
        (min(5.0, 0.17 * allowed.rate_Hz), 0.15, 0.4, 0.8),
    ):
        times = np.arange(_count(part * duration_s, allowed)) * allowed.step_s
        wave = 0.5 * (1.0 - np.cos(2.0 * np.pi * frequency_Hz * times))
        parts.append(top_V * (low + (high - low) * wave))
    return np.concatenate(parts)


def _minor_loops(top_V: float, duration_s: float, allowed: Allowed) -> Array:
    corners = top_V * np.array([0.0, 1.0, 0.15, 0.85, 0.3, 0.7, 0.42, 0.58, 0.5, 0.0])
    at = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)))])
    rows = np.linspace(0.0, at[-1], _count(duration_s, allowed))
    return np.interp(rows, at, corners)


def _small_steps(top_V: float, small_V: float, duration_s: float, allowed: Allowed) -> Array:
    ladder = small_V * np.array([1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 0.0])
    return _held(np.concatenate([ladder, 0.5 * top_V + ladder]), duration_s, allowed)


def _random_levels(top_V: float, duration_s: float, allowed: Allowed, rng: np.random.Generator) -> Array:
    parts, left = [], _count(duration_s, allowed)
    while left > 0:
        rows = min(left, _count(float(np.exp(rng.uniform(np.log(0.05), np.log(1.2)))), allowed))
        parts.append(np.full(rows, rng.uniform(0.0, top_V)))
        left -= rows
    return np.concatenate(parts)


def _fast(allowed: Allowed, top_V: float, duration_s: float, rng: np.random.Generator, *, falling: bool) -> Array:
    """Steps with time to ring, a sweep through the resonances with soft ends, and triangles."""
    parts, left = [], _count(0.4 * duration_s, allowed)
    while left > 0:
        rows = min(left, _count(float(np.exp(rng.uniform(np.log(0.03), np.log(0.4)))), allowed))
        parts.append(np.full(rows, rng.uniform(0.0, top_V)))
        left -= rows
    x = np.linspace(0.0, 1.0, _count(0.4 * duration_s, allowed))
    low_Hz, high_Hz, sweep_s = 20.0, 0.22 * allowed.rate_Hz, 0.4 * duration_s
    grown = np.log(high_Hz / low_Hz)
    turns = low_Hz * sweep_s / grown * np.expm1(grown * x)
    wave = 0.03 * np.minimum(1.0, 20.0 * np.minimum(x, 1.0 - x)) * np.sin(2.0 * np.pi * turns)
    sweep = top_V * (0.5 + (wave[::-1] if falling else wave))
    return np.concatenate([*parts, sweep, _minor_loops(top_V, 0.2 * duration_s, allowed)])
