"""The regression behind SINDy: rates of the displacement against candidate terms, strong or weak.

Strong: derivatives at the rows, from PySINDy's finite differences. Weak (Messenger and Bortz, Journal of Computational
Physics 443, 2021): both sides are integrated over short windows against a bump that is zero at their ends, so no
reading is differentiated. PySINDy's own weak library draws its windows from numpy's global random state and
takes one time grid for all records; these windows are evenly spaced on the grid of each stretch.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_identify.fitting.resimulation import Array
from bender_identify.records.experiment import Experiment
from bender_identify.regression.terms import library, scale_of

FEWEST_ROWS = 16
LONGEST_GAP_ROWS = 3
QUIET = 1e-4
"""Noise below this part of the readings' rms leaves derivatives usable."""
WINDOW_ROWS = 16
WINDOWS_PER_TURN = 2.0
BUMP_POWER = 4
SAME = 0.9995
"""Columns whose directions have a larger cosine than this are one: under noise they would trade without end."""


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """An even run of rows without a break: (n,) times, displacement about its zero, voltage."""

    time_s: Array
    w_um: Array
    u_V: Array


@dataclass(frozen=True, slots=True, eq=False)
class Regression:
    """rates = library @ coefficients, with w, u and time scaled to unit size.

    Attributes:
        terms: the candidates.
        library: (n, k).
        rates: (n,).
        scales: (k,) a coefficient in um, V and s is its scaled one times this.
        form: `strong` or `weak`.
        block_rows: rows that are resampled together, since neighbours are not independent.
        twins: (term left out, term that does the same in these records) pairs.
    """

    terms: tuple[str, ...]
    library: Array
    rates: Array
    scales: Array
    form: str
    block_rows: int
    twins: tuple[tuple[str, str], ...] = ()


def stretches_of(experiment: Experiment, zero_um: float) -> list[Stretch]:
    """Return the fitted rows as even stretches; short gaps are bridged, uneven times resampled."""
    rows = np.flatnonzero(experiment.fitted)
    if rows.size == 0:
        return []
    found = []
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > LONGEST_GAP_ROWS) + 1):
        if run.size < FEWEST_ROWS:
            continue
        time = experiment.time_s[run[0] : run[-1] + 1]
        w = np.interp(time, experiment.time_s[run], experiment.measured_um[run] - zero_um)
        u = experiment.acting_V[run[0] : run[-1] + 1]
        steps = np.diff(time)
        if np.ptp(steps) > 0.01 * steps.mean():
            even = np.linspace(time[0], time[-1], int((time[-1] - time[0]) / np.median(steps)) + 1)
            time, w, u = even, np.interp(even, time, w), np.interp(even, time, u)
        found.append(Stretch(time, w, u))
    return found


def regression_of(
    terms: Sequence[str], experiments: Sequence[Experiment], zero_um: float, form: str
) -> Regression | None:
    """Return the regression over all fitted rows, None where no stretch is long enough.

    Args:
        terms: candidates.
        experiments: the records.
        zero_um: the reading at rest under 0 V.
        form: `strong`, `weak`, or `auto` for the one that the noise asks for.
    """
    cut = [(stretch, x) for x in experiments for stretch in stretches_of(x, zero_um)]
    if not cut:
        return None
    w_um = _rms(np.concatenate([s.w_um for s, _ in cut]))
    u_V = _rms(np.concatenate([s.u_V for s, _ in cut]))
    rate = _rms(np.concatenate([np.gradient(s.u_V, s.time_s) for s, _ in cut]))
    if not (w_um > 0.0 and u_V > 0.0 and rate > 0.0):
        return None
    scale_s = u_V / rate
    if form == "auto":
        noise_um = max(x.excitation.noise_um for x in experiments)
        form = "strong" if noise_um < QUIET * w_um else "weak"
    parts, rates, rows = [], [], 1
    for stretch, experiment in cut:
        make = _strong if form == "strong" else _weak
        theta, rate_of_w, block = make(terms, _scaled(stretch, w_um, u_V, scale_s), _window_s(experiment) / scale_s)
        parts.append(theta)
        rates.append(rate_of_w)
        rows = max(rows, block)
    columns = np.concatenate(parts)
    kept, twins = _distinct_terms(terms, columns)
    scales = np.array([scale_of(terms[k], w_um, u_V, scale_s) for k in kept])
    names = tuple(terms[k] for k in kept)
    return Regression(names, columns[:, kept], np.concatenate(rates), scales, form, rows, twins)


def _distinct_terms(terms: Sequence[str], columns: Array) -> tuple[list[int], tuple[tuple[str, str], ...]]:
    """Return the columns to keep, of any two that are the same up to a factor the first; and the others with it."""
    size = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(size > 0.0, size, 1.0)
    kept: list[int] = []
    twins = []
    for k in range(len(terms)):
        same = [j for j in kept if abs(float(scaled[:, j] @ scaled[:, k])) > SAME]
        if size[k] == 0.0 or same:
            twins.append((terms[k], terms[same[0]] if same else "nothing"))
        else:
            kept.append(k)
    return kept, tuple(twins)


def _scaled(stretch: Stretch, w_um: float, u_V: float, scale_s: float) -> Stretch:
    return Stretch(stretch.time_s / scale_s, stretch.w_um / w_um, stretch.u_V / u_V)


def _window_s(experiment: Experiment) -> float:
    duration = float(experiment.time_s[-1] - experiment.time_s[0])
    return duration / (WINDOWS_PER_TURN * max(experiment.excitation.turns, 4))


def _strong(terms: Sequence[str], stretch: Stretch, window: float) -> tuple[Array, Array, int]:
    import pysindy

    differentiate = pysindy.FiniteDifference(order=4)
    step = stretch.time_s[1] - stretch.time_s[0]
    rate = np.asarray(differentiate(stretch.u_V[:, None], step))[:, 0]
    rate_of_w = np.asarray(differentiate(stretch.w_um[:, None], step))[:, 0]
    # one-sided differences at the ends are poorer, and the record may begin with a jump
    inside = slice(4, -4)
    theta = library(terms, stretch.w_um[inside], stretch.u_V[inside], rate[inside])
    return theta, rate_of_w[inside], max(8, int(window / step))


def _weak(terms: Sequence[str], stretch: Stretch, window: float) -> tuple[Array, Array, int]:
    step = stretch.time_s[1] - stretch.time_s[0]
    half = max(WINDOW_ROWS // 2, int(0.5 * window / step))
    half = min(half, (len(stretch.time_s) - 1) // 2)
    x = np.arange(-half, half + 1) / half
    bump = (1.0 - x * x) ** BUMP_POWER
    slope = -2.0 * BUMP_POWER * x * (1.0 - x * x) ** (BUMP_POWER - 1) / (half * step)
    centres = np.arange(half, len(stretch.time_s) - half, max(1, half // 4))
    rows = centres[:, None] + np.arange(-half, half + 1)
    rate = np.gradient(stretch.u_V, step)
    theta = library(terms, stretch.w_um, stretch.u_V, rate)
    weight = bump / bump.sum()
    integrals = np.einsum("j,cjk->ck", weight, theta[rows])
    rates = -(stretch.w_um[rows] @ (slope / bump.sum()))
    return integrals, rates, 8


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values * values)))


def conditioning(columns: NDArray[np.float64]) -> tuple[float, Array, Array]:
    """Return the condition number of columns scaled to unit length, their singular values and right vectors."""
    size = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(size > 0.0, size, 1.0)
    _, values, vectors = np.linalg.svd(scaled, full_matrices=False)
    return float(values[0] / values[-1]) if values[-1] > 0.0 else float("inf"), values, vectors
