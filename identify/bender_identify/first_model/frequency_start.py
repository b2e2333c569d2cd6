"""Starts by way of the frequency response: a rational function through it, by linear least squares, for every delay.

H(s) exp(s T) (1 + a1 s + ... + an s^n) = b0 + b1 s + ... is linear in a and b (Levy 1959,
doi:10.1109/TAC.1959.6429401); weighed by the denominator of the turn before, it is the error of the response itself
(Sanathanan and Koerner 1963, doi:10.1109/TAC.1963.1105517).

The roots of the denominator are the lags and modes, whatever hides one from another.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bender_identify.first_model.structures import MOST_DAMPING, Structure
from bender_identify.records.experiment import Experiment

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

SEGMENTS, FEWEST_ROWS = 4, 64
TURNS = 6
BEST_DELAYS = 4
SHARES = (0.1, 0.3, 0.6)
LEAST_POWER = 1e-6
"""Of the strongest part of the input's spectrum: where there is less, nothing is driven."""


def response(experiment: Experiment) -> tuple[Array, Complex, Array] | None:
    """Return angular frequency in rad/s, response and weight (m,) of a record, by Welch's method; None where short."""
    from scipy.signal import csd, welch

    seen = np.isfinite(experiment.measured_um)
    rows = experiment.time_s.size
    if int(seen.sum()) < SEGMENTS * FEWEST_ROWS:
        return None
    time_s = np.linspace(float(experiment.time_s[0]), float(experiment.time_s[-1]), rows)
    y = np.interp(time_s, experiment.time_s[seen], experiment.measured_um[seen])
    u = np.interp(time_s, experiment.time_s, experiment.acting_V)
    rate, length = 1.0 / float(time_s[1] - time_s[0]), max(FEWEST_ROWS, rows // SEGMENTS)
    frequency, power = welch(u, rate, nperseg=length)
    _, read = welch(y, rate, nperseg=length)
    _, cross = csd(u, y, rate, nperseg=length)
    driven = (power > LEAST_POWER * power[1:].max()) & (frequency > 0.0) & (read > 0.0)
    if int(driven.sum()) < FEWEST_ROWS // 4:
        return None
    # what acts up to a row stands in it, held: on average it has acted half a row before
    omega = 2.0 * np.pi * frequency[driven]
    found = (cross[driven] / power[driven]) * np.exp(-0.5j * omega / rate)
    coherence = np.abs(cross[driven]) ** 2 / (power[driven] * read[driven])
    return omega, np.asarray(found, dtype=np.complex128), np.sqrt(power[driven] * np.minimum(coherence, 1.0))


def rational(omega: Array, found: Complex, weight: Array, zeros: int, poles: int) -> tuple[float, Complex]:
    """Return what the best rational function leaves, weighed, and the roots of its denominator in rad/s."""
    scale = float(np.exp(np.mean(np.log(omega))))
    s = 1j * omega / scale
    above = s[:, None] ** np.arange(zeros + 1)
    below = s[:, None] ** np.arange(1, poles + 1)
    by, left, b, a = weight, np.inf, np.zeros(zeros + 1), np.zeros(poles)
    for _ in range(TURNS):
        columns = by[:, None] * np.hstack([above, -found[:, None] * below])
        right = by * found
        both = np.vstack([columns.real, columns.imag]), np.concatenate([right.real, right.imag])
        x = np.linalg.lstsq(*both, rcond=None)[0]
        b, a = x[: zeros + 1], x[zeros + 1 :]
        denominator = 1.0 + below @ a
        by = weight / np.maximum(np.abs(denominator), 1e-12)
        left = float(np.sum((weight * np.abs(found - (above @ b) / denominator)) ** 2))
    return left, np.asarray(np.roots([*a[::-1], 1.0]) * scale, dtype=np.complex128)


def frequency_starts(structure: Structure, experiment: Experiment, delays_s: Array) -> Iterator[tuple[float, ...]]:
    """Yield numbers of a structure whose lags and modes are roots of a response, for the delays that fit it best."""
    known = response(experiment) if structure.order else None
    if known is None:
        return
    omega, found, weight = known
    tried = []
    for delay in delays_s if structure.delay else np.zeros(1):
        late = found * np.exp(1j * omega * delay)
        tried.append((*rational(omega, late, weight, 2 * (structure.modes > 1), structure.order), float(delay)))
    tried.sort(key=lambda x: x[0])
    for _, roots, delay in tried[:BEST_DELAYS]:
        for numbers in _numbers(structure, roots):
            yield (*numbers, *([delay] if structure.delay else []))


def _numbers(structure: Structure, roots: Complex) -> Iterator[tuple[float, ...]]:
    """Yield the numbers that roots stand for, those on the unstable side mirrored; none where they are of another kind.

    A lag is a real root, a mode a pair; which of two modes is the first is tried either way.
    """
    pairs = [x for x in roots if x.imag > 1e-9 * abs(x)]
    real = [abs(x.real) for x in roots if abs(x.imag) <= 1e-9 * abs(x)]
    if len(pairs) != structure.modes or len(real) != structure.lags or any(x <= 0.0 for x in real):
        return
    lags = sorted((1.0 / x for x in real), reverse=True)
    modes = [(abs(x) / (2.0 * np.pi), min(max(abs(x.real) / abs(x), 1e-3), MOST_DAMPING)) for x in pairs]
    if structure.modes < 2:
        yield (*map(float, lags), *(float(x) for mode in modes for x in mode))
        return
    for first, second in (modes, modes[::-1]):
        yield from ((*map(float, lags), *map(float, first), *map(float, second), share) for share in SHARES)
