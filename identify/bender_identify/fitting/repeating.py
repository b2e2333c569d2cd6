"""A residual that comes back in every cycle: not noise, and more readings of it teach nothing new.

A tracker that errs with the place of the tip, or an equation that lacks a term, leaves the same error in each cycle of
a periodic record. Such an error has one draw for each phase, however many cycles are read, so the uncertainty of what
is fitted does not fall with their number.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bender_identify.fitting.correlation import correlation_rows
from bender_identify.records.experiment import Experiment

Array = NDArray[np.float64]

FEWEST_CYCLES, FEWEST_PHASES = 3, 8
CLEARLY = 3.0
"""Standard deviations by which the mean cycle must exceed what noise leaves of it."""


def repeating_factor(experiments: Sequence[Experiment], residual_um: Array, rows: float) -> float:
    """Return the factor >= 1 by which the variance of fitted parameters grows beyond that of correlated noise.

    Args:
        experiments: whose fitted rows the residual covers, one after the other.
        residual_um: (n,) measured minus simulated.
        rows: that count as one reading in the noise.
    """
    parts = np.split(residual_um, np.cumsum([int(x.fitted.sum()) for x in experiments])[:-1])
    power = sum(float(part @ part) for part in parts)
    if power == 0.0:
        return 1.0
    grown = sum(_grown(x, part, rows) * float(part @ part) for x, part in zip(experiments, parts, strict=True))
    return max(1.0, grown / power)


def _grown(experiment: Experiment, residual_um: Array, rows: float) -> float:
    period_s = experiment.excitation.period_s
    if period_s is None or not experiment.excitation.one_amplitude:
        return 1.0
    cycles = _folded(experiment.time_s[experiment.fitted], residual_um, period_s)
    if len(cycles) < FEWEST_CYCLES or cycles.shape[1] < FEWEST_PHASES:
        return 1.0
    count, phases = cycles.shape
    mean = cycles.mean(axis=0)
    noise = float(np.mean(cycles.var(axis=0, ddof=1))) / count
    repeated = float(np.mean(mean * mean)) - noise
    if repeated <= CLEARLY * np.sqrt(2.0 / phases) * noise:
        return 1.0
    share = min(1.0, repeated / float(np.mean(cycles * cycles)))
    return (1.0 - share) + share * count * correlation_rows(mean) / rows


def _folded(time_s: Array, residual_um: Array, period_s: float) -> Array:
    """Return the residual as (cycles, phases); a last cycle that is cut off is left out."""
    rows = np.flatnonzero(np.diff(time_s, prepend=time_s[0]) > period_s)
    begin = int(rows[-1]) if rows.size else 0  # the reading at rest may stand apart from the rest
    time, residual = time_s[begin:], residual_um[begin:]
    count = int((time[-1] - time[0]) / period_s + 1e-9)
    phases = max(1, round(period_s / float(np.median(np.diff(time)))))
    instants = time[0] + period_s * (np.arange(count)[:, None] + np.arange(phases) / phases)
    return np.interp(instants, time, residual)
