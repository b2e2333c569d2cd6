"""A disturbance, scanned in the spectrum of the residual."""

import numpy as np
from numpy.typing import NDArray

from bender_effects.form import Form
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.scans.misfit import deepest_valleys, square_beside
from bender_inference.fitting.standing import Standing
from bender_inference.fitting.starts import Start, solved
from bender_inference.records.command_lines import command_lines_Hz
from bender_inference.records.observations import Array, Observations
from bender_inference.records.spectrum import bin_s, spectrum, swing_columns

# two lines of a spectrum, in units of one over its record
LINES_APART = 2.0


def scan_hum(
    problem: FitProblem, base: Hypothesis, form: Form, keep: int, beside: Standing | None = None
) -> list[Start]:
    """Scan the frequency of a disturbance in the spectrum of the residual of the longest record."""
    readings = problem.readings(base)
    if readings is None:
        return []
    residuals = problem.residuals(readings, problem.calibrate(readings))
    rows = [(x.time_s[x.training], r[x.training]) for x, r in zip(problem.observations, residuals, strict=True)]
    longest = max(range(len(rows)), key=lambda k: rows[k][0].size)
    x, (times, residual) = problem.observations[longest], rows[longest]
    frequencies, power = spectrum(times, residual - residual.mean(), bin_s(x.time_s))
    power = np.where(frequencies > 1.5 / float(np.ptp(x.time_s)), power, 0.0)
    power[_of_the_drive(x, frequencies)] = 0.0
    found = []
    for k in deepest_valleys(-power, keep):
        values: list[float] = []
        left: list[Array] = []
        for each in rows[: form.records]:
            weights, rest = _swing(*each, float(frequencies[k]))
            values += [*weights, float(frequencies[k])]
            left.append(rest)
        left += [residual for _, residual in rows[form.records :]]
        found.append(Start(tuple(values), square_beside(np.concatenate(left), beside)))
    return found


def _swing(times: Array, residual: Array, frequency_Hz: float) -> tuple[tuple[float, float], Array]:
    """Return the sine and the cosine of a frequency in a residual, and what they leave of it."""
    columns = swing_columns(times, frequency_Hz)
    weights, _ = solved(list(columns.T), residual)
    left = residual - columns @ weights
    return (float(weights[0]), float(weights[1])), left


def _of_the_drive(x: Observations, frequencies: Array) -> NDArray[np.bool_]:
    """Return which frequencies are lines of the command, overtones or aliases of these: none is a disturbance.

    The overtones of a line count where there is as much room between them as they take: else they would be everywhere.
    """
    own = np.zeros(frequencies.size, dtype=bool)
    apart_Hz = LINES_APART / float(np.ptp(x.time_s))
    rate_Hz = 1.0 / float(np.median(np.diff(x.time_s)))
    for line_Hz in command_lines_Hz(x.time_s, x.command_V):
        highest = np.inf if line_Hz > 4.0 * apart_Hz else 1.0
        for seen_Hz in (frequencies, np.abs(frequencies - rate_Hz * np.round(frequencies / rate_Hz))):
            overtone = np.clip(np.round(seen_Hz / line_Hz), 1.0, highest)
            own |= np.abs(seen_Hz - line_Hz * overtone) < apart_Hz
    return own
