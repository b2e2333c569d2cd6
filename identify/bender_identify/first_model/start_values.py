"""Where the fits of a structure begin: a grid over time constants and frequencies, peaks of the spectrum, delays.

A start is found without fitting: one number of a new part is scanned while the parts that a simpler structure already
has keep theirs, and gain and offset are solved for at every point of the scan.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from bender_identify.first_model.fit import FirstFit, FitTask, Mask, evaluated
from bender_identify.first_model.frequency_start import frequency_starts
from bender_identify.first_model.structures import LEAST_PERIODS, LONGEST_LAG_S, HIGHEST_Hz, LOWEST_Hz, Structure
from bender_identify.records.experiment import Experiment

Array = NDArray[np.float64]

LAGS_PER_DECADE, MODES_PER_DECADE = 4, 6
DAMPING_RATIOS = (0.03, 0.3)
MOST_PEAKS = 4
LEAST_OF_A_DELAY, MOST_OF_A_DELAY, MOST_DELAYS = 0.3, 1.05, 200
DELAYS = 24
"""Points of a scan over the delay, first in whole rows and then wider apart."""
SHARES = (0.1, 0.5)
SEGMENTS, FEWEST_ROWS = 8, 64


def delays_s(task: FitTask, longest_s: float) -> Array:
    """Return the delays that are scanned (m,): 0, then ever wider apart up to the longest."""
    rows = max(longest_s / task.delay_unit_s, 1.0)
    points = np.unique(np.concatenate([[0.0, 0.5], np.geomspace(1.0, rows, DELAYS)]))
    return points * task.delay_unit_s


def time_constants_s(task: FitTask) -> Array:
    """Return the time constants that are scanned: from a fifth of a row to a third of the longest record."""
    longest = max(float(np.ptp(x.time_s)) for x in task.experiments)
    low, high = 0.2 * task.delay_unit_s, min(longest / 3.0, LONGEST_LAG_S)
    return np.geomspace(low, high, max(3, int(LAGS_PER_DECADE * np.log10(high / low)) + 1))


def frequencies_Hz(task: FitTask) -> Array:
    """Return the frequencies that are scanned: peaks of the response first, then a grid up to the Nyquist frequency."""
    longest = max(float(np.ptp(x.time_s)) for x in task.experiments)
    low, high = max(LEAST_PERIODS / longest, LOWEST_Hz), min(0.5 / task.delay_unit_s, HIGHEST_Hz)
    grid = np.geomspace(low, high, max(4, int(MODES_PER_DECADE * np.log10(high / low)) + 1))
    peaks = [f for x in task.experiments for f in response_peaks_Hz(x)]
    return np.unique(np.concatenate([grid, [f for f in peaks if low <= f <= high]]))


def response_peaks_Hz(experiment: Experiment) -> list[float]:
    """Return the highest peaks of |H(f)| = |S_uy / S_uu| where the input has power, by Welch's method."""
    from scipy.signal import csd, find_peaks, welch

    seen = np.isfinite(experiment.measured_um)
    rows = experiment.time_s.size
    if int(seen.sum()) < FEWEST_ROWS:
        return []
    time_s = np.linspace(float(experiment.time_s[0]), float(experiment.time_s[-1]), rows)
    y = np.interp(time_s, experiment.time_s[seen], experiment.measured_um[seen])
    u = np.interp(time_s, experiment.time_s, experiment.acting_V)
    rate, length = 1.0 / float(time_s[1] - time_s[0]), max(FEWEST_ROWS, rows // SEGMENTS)
    frequency, power = welch(u, rate, nperseg=length)
    _, cross = csd(u, y, rate, nperseg=length)
    driven = power > 1e-6 * power[1:].max()
    response = np.where(driven, np.abs(cross) / np.where(driven, power, 1.0), 0.0)
    peaks, about = find_peaks(response[1:], prominence=0.0)
    best = peaks[np.argsort(about["prominences"])[::-1][:MOST_PEAKS]] + 1
    return [float(frequency[k]) for k in best]


def starts(
    task: FitTask, structure: Structure, simpler: Sequence[FirstFit], masks: Sequence[Mask], keep: int
) -> list[tuple[float, ...]]:
    """Return where fits of a structure begin, best first: the most promising points of the scans.

    Args:
        task: the records.
        structure: what is to be fitted.
        simpler: fits of structures with a lag, a mode or the delay less.
        masks: rows that count, for every record.
        keep: how many starts are wanted.
    """
    tried: list[tuple[float, tuple[float, ...]]] = []
    for values in _candidates(task, structure, simpler):
        found = evaluated(task, structure, values, masks)
        if found is not None:
            tried.append((found.square(masks), values))
    tried.sort(key=lambda x: x[0])
    return [values for _, values in tried[:keep]]


def _candidates(task: FitTask, structure: Structure, simpler: Sequence[FirstFit]) -> Iterator[tuple[float, ...]]:
    if not structure.names:
        yield ()
        return
    if structure == Structure(modes=1, delay=True):
        yield from _mode_and_delay(task)
    for x in task.experiments:
        yield from frequency_starts(structure, x, _delays_about_s(task, simpler))
    for fit in simpler:
        known = fit.structure
        if known == Structure(structure.lags, structure.modes):
            for delay in delays_s(task, _longest_delay_s(task)):
                for factor in (1.0, 0.5):
                    yield (*_quicker(known, fit.values, factor), float(delay))
        elif known.delay == structure.delay:
            yield from _with_one_more(task, structure, fit)


def _mode_and_delay(task: FitTask) -> Iterator[tuple[float, ...]]:
    """A long delay hides a mode from a model without one, and the mode hides the delay."""
    for frequency in {f for x in task.experiments for f in response_peaks_Hz(x)}:
        for delay in delays_s(task, _longest_delay_s(task)):
            yield from ((frequency, damping, float(delay)) for damping in DAMPING_RATIOS)


def _longest_delay_s(task: FitTask) -> float:
    return task.longest_delay_s


def _delays_about_s(task: FitTask, simpler: Sequence[FirstFit]) -> Array:
    """Return delays (m,) of half a row to the next about those of simpler structures, which lacked a lag or a mode."""
    known = [x.values[-1] for x in simpler if x.structure.delay]
    if not known:
        return delays_s(task, _longest_delay_s(task))
    low, high = LEAST_OF_A_DELAY * min(known), MOST_OF_A_DELAY * max(known) + task.delay_unit_s
    return np.linspace(low, high, min(int(2.0 * (high - low) / task.delay_unit_s) + 2, MOST_DELAYS))


def _quicker(structure: Structure, values: Sequence[float], factor: float) -> tuple[float, ...]:
    """Return numbers with quicker lags and higher frequencies: a slow part may have stood in for the delay."""
    found = []
    for name, value in zip(structure.names, values, strict=True):
        slower = name.startswith("time_constant")
        found.append(value * factor if slower else value / factor if name.startswith("frequency") else value)
    return tuple(found)


def residual_peaks_Hz(task: FitTask, fit: FirstFit) -> list[float]:
    """Return the highest peaks of the power of what a fit leaves, up to the Nyquist frequency, by Welch's method."""
    from scipy.signal import find_peaks, welch

    found: list[float] = []
    for left, x in zip(fit.residuals, task.experiments, strict=True):
        if left.size < FEWEST_ROWS:
            continue
        rate = 1.0 / float(np.median(np.diff(x.time_s)))
        frequency, power = welch(np.nan_to_num(left), rate, nperseg=max(FEWEST_ROWS, left.size // SEGMENTS))
        peaks, _ = find_peaks(power[1:])
        best = peaks[np.argsort(power[1:][peaks])[::-1][:MOST_PEAKS]] + 1
        found += [float(frequency[k]) for k in best]
    return found


def _with_one_more(task: FitTask, structure: Structure, fit: FirstFit) -> Iterator[tuple[float, ...]]:
    known, values = fit.structure, list(fit.values)
    delay = [values.pop()] if known.delay else []
    lags, modes = values[: known.lags], values[known.lags :]
    if structure.lags == known.lags + 1 and structure.modes == known.modes:
        for tau in time_constants_s(task):
            yield (*sorted([*lags, float(tau)], reverse=True), *modes, *delay)
    elif structure.modes == known.modes + 1 and structure.lags == known.lags:
        rings = {float(x) for x in frequencies_Hz(task)} | set(residual_peaks_Hz(task, fit))
        for frequency in sorted(rings):
            for damping in DAMPING_RATIOS:
                if known.modes == 0:
                    # a mode delays by 2 zeta / omega what a delay alone had to make up for
                    late = [max(x - damping / (np.pi * frequency), 0.0) for x in delay]
                    yield from ((*lags, frequency, damping, *x) for x in dict.fromkeys([tuple(delay), tuple(late)]))
                else:
                    for share in SHARES:
                        yield (*lags, *modes, frequency, damping, share, *delay)
