"""The excitations of the records: rich ones of either sensor, others for a second record, and weak ones."""

from collections.abc import Callable

import numpy as np
from bender_proving.records.excitation import RATE_HZ, Excitation, even
from bender_proving.cases.hidden import Sensor, log_uniform
from bender_proving.physics.lobatto import Array
from bender_proving.cases.nominal import FULL_VOLTAGE_V
from numpy.random import Generator

CAMERA_S, VIBROMETER_S = 170.0, 6.0
_LEAD = 0.12
Piece = Callable[[Generator, float, float], Array]


def _held(levels: Array, durations_s: Array, rate_Hz: float) -> Array:
    return np.repeat(levels, np.maximum(1, np.rint(durations_s * rate_Hz)).astype(np.intp))


def _staircase(rng: Generator, rate_Hz: float, seconds: float) -> Array:
    count = int(rng.integers(10, 18))
    up = np.sort(rng.uniform(0.0, FULL_VOLTAGE_V, count))
    up[-1] = FULL_VOLTAGE_V
    down = np.sort(rng.uniform(0.0, FULL_VOLTAGE_V, count))[::-1]
    down[-1] = 0.0
    return _held(np.concatenate([up, down]), rng.uniform(0.7, 1.3, 2 * count) * seconds / (2 * count), rate_Hz)


def _holds(rng: Generator, rate_Hz: float, seconds: float) -> Array:
    shares = rng.permutation(np.concatenate([[0.55, 0.2, 0.1], np.geomspace(0.06, 0.004, 8)]))
    far = np.where(
        np.arange(len(shares)) % 2 == 0, rng.uniform(25.0, 50.0, len(shares)), rng.uniform(0, 15, len(shares))
    )
    return _held(far, shares / shares.sum() * seconds, rate_Hz)


def _sines(rng: Generator, rate_Hz: float, seconds: float) -> Array:
    amplitudes = rng.permutation([3.0, 8.0, 15.0, 24.0]) * rng.uniform(0.8, 1.0, 4)
    frequencies_Hz = rng.permutation([0.25, 0.6, 1.5, 4.0]) * rng.uniform(0.8, 1.2, 4)
    rows = np.arange(round(seconds / 4 * rate_Hz)) / rate_Hz
    parts = []
    for amplitude, frequency_Hz in zip(amplitudes, frequencies_Hz, strict=True):
        middle = rng.uniform(amplitude, FULL_VOLTAGE_V - amplitude)
        parts.append(middle + amplitude * np.sin(2.0 * np.pi * frequency_Hz * rows))
    return np.concatenate(parts)


def _random_levels(rng: Generator, rate_Hz: float, seconds: float) -> Array:
    count = int(np.ceil(seconds / 0.25))
    durations_s = np.exp(rng.uniform(np.log(0.05), np.log(0.8), count))
    return _held(rng.uniform(0.0, FULL_VOLTAGE_V, count), durations_s * seconds / durations_s.sum(), rate_Hz)


def _triangles(rng: Generator, rate_Hz: float, seconds: float) -> Array:
    peaks = np.linspace(FULL_VOLTAGE_V, 6.0, 7) * rng.uniform(0.9, 1.0, 7)
    middle = 0.5 * FULL_VOLTAGE_V
    corners = np.concatenate([[0.0], *([middle + 0.5 * peak, middle - 0.5 * peak] for peak in peaks), [0.0]])
    at = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)))])
    rows = np.arange(round(seconds * rate_Hz)) / (seconds * rate_Hz)
    return np.interp(rows * at[-1], at, corners)


def _two_tones(rng: Generator, rate_Hz: float, seconds: float) -> Array:
    rows = np.arange(round(seconds * rate_Hz)) / rate_Hz
    slow, fast = 2.0 * np.pi * log_uniform(rng, 0.1, 0.4), 2.0 * np.pi * log_uniform(rng, 0.8, 5.0)
    share = rng.uniform(0.5, 0.8)
    return FULL_VOLTAGE_V / 2 * (1.0 + 0.95 * (share * np.sin(slow * rows) + (1.0 - share) * np.sin(fast * rows)))


def _two_levels(rng: Generator, rate_Hz: float, seconds: float) -> Array:
    count = int(np.ceil(seconds / 0.6))
    durations_s = rng.exponential(1.0, count) + 0.1
    low, high = rng.uniform(0.0, 20.0), rng.uniform(30.0, 50.0)
    return _held(np.where(np.arange(count) % 2, low, high), durations_s * seconds / durations_s.sum(), rate_Hz)


def _chirp(rng: Generator, rate_Hz: float, seconds: float, *, falling: bool = False) -> Array:
    """Logarithmic chirp through the resonance with soft ends, some volts around a constant."""
    x = np.arange(round(seconds * rate_Hz)) / (seconds * rate_Hz)
    low_Hz, high_Hz = 20.0, 900.0
    turns = low_Hz * seconds / np.log(high_Hz / low_Hz) * ((high_Hz / low_Hz) ** x - 1.0)
    amplitude = log_uniform(rng, 0.5, 3.0) * np.minimum(1.0, 20.0 * np.minimum(x, 1.0 - x))
    wave = rng.uniform(10.0, 40.0) + amplitude * np.sin(2.0 * np.pi * turns)
    return wave[::-1] if falling else wave


def _falling_chirp(rng: Generator, rate_Hz: float, seconds: float) -> Array:
    return _chirp(rng, rate_Hz, seconds, falling=True)


def _steps(rng: Generator, rate_Hz: float, seconds: float) -> Array:
    count = int(np.ceil(seconds / 0.12))
    durations_s = np.exp(rng.uniform(np.log(0.03), np.log(0.4), count))
    return _held(rng.uniform(0.0, FULL_VOLTAGE_V, count), durations_s * seconds / durations_s.sum(), rate_Hz)


_PLANS: dict[tuple[Sensor, bool], tuple[tuple[tuple[Piece, float], ...], ...]] = {
    ("camera", True): (((_staircase, 16.0), (_holds, 32.0), (_sines, 20.0), (_random_levels, 16.0)),) * 2,
    ("camera", False): (((_two_tones, 24.0), (_triangles, 26.0), (_two_levels, 16.0), (_staircase, 18.0)),) * 2,
    ("vibrometer", True): (((_steps, 1.5), (_chirp, 1.5)),) * 2,
    ("vibrometer", False): (((_falling_chirp, 1.2), (_steps, 1.2), (_triangles, 0.6)),) * 2,
}


def rich(sensor: Sensor, rng: Generator, duration_s: float | None = None, *, first: bool = True) -> Excitation:
    """An excitation that shows every effect of its sensor.

    Camera: staircase 0-50-0 V, holds over several decades of time, sines, random levels; vibrometer: steps and chirps
    through the resonance. `first=False` gives another kind of excitation of the same bench: triangles of falling
    amplitude, two tones and two levels, or falling chirps. About 170 s and 6 s unless told otherwise.
    """
    rate_Hz = RATE_HZ[sensor]
    usual_s = CAMERA_S if sensor == "camera" else VIBROMETER_S
    seconds = usual_s if duration_s is None else duration_s
    parts = [np.zeros(max(1, round(0.01 * seconds * rate_Hz)))]
    for plan in _PLANS[sensor, first]:
        for k in rng.permutation(len(plan)):
            piece, share_s = plan[k]
            parts.append(piece(rng, rate_Hz, share_s * seconds / usual_s))
    voltage_V = np.clip(np.round(np.concatenate(parts), 3), 0.0, FULL_VOLTAGE_V)
    rows = round(seconds * rate_Hz)
    padded = np.concatenate([voltage_V, np.zeros(max(0, rows - len(voltage_V)))])
    return even(sensor, padded[:rows])


def begun(sensor: Sensor, rng: Generator, start: str) -> Excitation:
    """A rich excitation that begins before the first row ("motion"), or with a step in it from 0 V ("step")."""
    usual_s = CAMERA_S if sensor == "camera" else VIBROMETER_S
    lead_s = _LEAD * usual_s
    voltage_V = rich(sensor, rng, usual_s + lead_s).voltage_V
    lead = round(lead_s * RATE_HZ[sensor])
    if start == "motion":
        return even(sensor, voltage_V, lead)
    played_V = np.array(voltage_V[lead:])
    played_V[: max(1, round(0.1 * lead))] = round(float(rng.uniform(10.0, 40.0)), 3)
    return even(sensor, played_V)


def one_sine(
    rng: Generator, frequency_Hz: float, amplitude_V: float, duration_s: float = 30.0, lead_s: float = 20.0
) -> Excitation:
    """One frequency at one amplitude before the camera, running since `lead_s` before the first row.

    The recorded rows do not depend on `lead_s`.
    """
    rate_Hz = RATE_HZ["camera"]
    lead = round(lead_s * rate_Hz)
    rows = np.arange(-lead, round(duration_s * rate_Hz)) / rate_Hz
    phase = rng.uniform(0.0, 2.0 * np.pi)
    middle = rng.uniform(amplitude_V, FULL_VOLTAGE_V - amplitude_V)
    wave = middle + amplitude_V * np.sin(2.0 * np.pi * frequency_Hz * rows + phase)
    return even("camera", np.clip(np.round(wave, 3), 0.0, FULL_VOLTAGE_V), lead)


def one_step(voltage_V: float, duration_s: float) -> Excitation:
    """One step from 0 V before the camera, two frames after the first row, then nothing."""
    rows = round(duration_s * RATE_HZ["camera"])
    levels = np.full(rows, round(voltage_V, 3))
    levels[:2] = 0.0
    return even("camera", levels)
