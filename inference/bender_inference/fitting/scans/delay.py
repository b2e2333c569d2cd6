"""A delay, scanned on one simulation that is read at shifted instants."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator

from bender_compiled.simulation import Simulator
from bender_effects.form import Form
from bender_inference.fitting.fit_problem import ROUGH, FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.scans.misfit import deepest_valleys
from bender_inference.fitting.standing import Standing
from bender_inference.fitting.starts import Start
from bender_inference.records.observations import Array, Observations
from bender_plant.model import ModelError

STEP_IN_UNITS, MOST_STEPS = 0.5, 20_000
"""A step of the scan, in units of the delay, and how many there are at most: of the actuator 0.5 ms, fine beside a
quarter of its ringing period (2.4 ms); of another device a tenth of a row."""
VALLEYS, NEAR = 12, 25
"""Of a delay, that are scanned closely, and in how many steps."""
MOST_DELAYED_ROWS, DELAYS_TOGETHER = 2000, 50
"""Rows that a scan of the delay looks at, and delays that are tried on them at once."""


def _scanned(x: Observations) -> NDArray[np.intp]:
    """Return the training rows that a scan of the delay looks at: all of them, or many spread over the record."""
    rows = np.flatnonzero(x.training)
    if rows.size <= MOST_DELAYED_ROWS:
        return rows
    return rows[np.linspace(0, rows.size - 1, MOST_DELAYED_ROWS).astype(int)]


@dataclass(frozen=True, slots=True, eq=False)
class _Curve:
    """Readings that are simulated at close instants, as far back from every row of a record as a delay may reach.

    Attributes:
        time_s: (m,) the instants, whole steps of a scan.
        reading_um: (m,) at them.
        at: (n,) which of the instants is the first one that is not before a row.
        early: (n,) how long before it the row is, in steps.
    """

    time_s: Array
    reading_um: Array
    at: NDArray[np.intp]
    early: Array

    def steps_before(self, steps: NDArray[np.intp]) -> Array:
        """Return the readings some steps (k,) before every row, (n, k), on straight lines between the instants."""
        places = self.at[:, None] - steps
        later = self.reading_um[np.maximum(places, 0)]
        earlier = self.reading_um[np.maximum(places - 1, 0)]
        return later + self.early[:, None] * (earlier - later)


def _dense(problem: FitProblem, base: Hypothesis, record: int, longest_s: float, step_s: float) -> _Curve | None:
    """Return the readings of a record at the instants of its scanned rows and, closely spaced, before them."""
    x = problem.observations[record]
    back = round(longest_s / step_s) + 1
    rows = x.time_s[_scanned(x)] / step_s
    steps = np.ceil(rows).astype(np.int64)
    instants = _covered(np.maximum(steps - back, 0), steps)
    times = np.asarray(step_s * instants, dtype=np.float64)
    drive = replace(x.drive, row_time_s=times)
    try:
        readings = Simulator(drive, coarser=ROUGH).run(base.model(problem.base, record)).reading_um
    except (ModelError, ArithmeticError):
        return None
    return _Curve(times, readings, np.searchsorted(instants, steps), steps - rows)


def _covered(first: NDArray[np.int64], last: NDArray[np.int64]) -> NDArray[np.intp]:
    """Return the whole numbers, none negative, that lie in any of some ranges, both ends included."""
    begun = np.bincount(first, minlength=int(last.max()) + 2)
    begun[1:] -= np.bincount(last, minlength=begun.size)[: begun.size - 1]
    return np.flatnonzero(np.cumsum(begun))


def scan_delay(
    problem: FitProblem, base: Hypothesis, form: Form, keep: int, beside: Standing | None = None
) -> list[Start]:
    """Scan the delay on one simulation that is read at shifted instants, and then closely where it promises most.

    Of a record whose steps lie on a grid of rows, a delay that is off by a period of the ringing misses little. Between
    such valleys no slope leads from one to the next, and each is so narrow that the steps of the scan do not tell how
    deep it is.
    """
    longest_s = form.free[0].high / 2.0
    step_s = max(STEP_IN_UNITS * form.free[0].unit, longest_s / MOST_STEPS)
    dense = [_dense(problem, base, k, longest_s, step_s) for k in range(len(problem.observations))]
    curves = [x for x in dense if x is not None]
    if len(curves) < len(dense):
        return []
    rows = [_scanned(x) for x in problem.observations]
    times = [x.time_s[k] for k, x in zip(rows, problem.observations, strict=True)]
    goals = [x.measured_um[k] for k, x in zip(rows, problem.observations, strict=True)]
    # as many rows as the other forms are judged on
    share = sum(int(x.training.sum()) for x in problem.observations) / sum(k.size for k in rows)
    beside = None if beside is None else beside.of(_places(problem, rows))

    def freed(parts: Sequence[Array]) -> Array:
        centred = np.concatenate([x - x.mean(axis=0) for x in parts])
        return centred if beside is None else beside.without_it(centred)

    measured = freed(goals)
    square = float(measured @ measured)

    def left(shifted: Sequence[Array]) -> Array:
        y = freed(shifted)
        power = np.sum(y**2, axis=0)
        taken = np.divide((measured @ y) ** 2, power, out=np.zeros(power.size), where=power > 0.0)
        return share * (square - taken)

    steps = np.arange(1, math.ceil(longest_s / step_s))
    parts = np.array_split(steps, max(1, math.ceil(steps.size / DELAYS_TOGETHER)))
    coarsely = np.concatenate([left([x.steps_before(part) for x in curves]) for part in parts])
    # a delay shorter than a step of the scan lies in the valley at zero
    valleys = step_s * np.array([0, *steps[deepest_valleys(coarsely, VALLEYS)]])
    closely = [Akima1DInterpolator(x.time_s, x.reading_um, extrapolate=True) for x in curves]
    near = step_s * np.linspace(-0.6, 0.6, NEAR)
    found = []
    for middle in valleys:
        around = np.maximum(middle + near, 0.0)
        squares = left([_late(*each, around) for each in zip(times, curves, closely, strict=True)])
        k = int(np.argmin(squares))
        found.append(Start((float(around[k]),), float(squares[k])))
    return sorted(found, key=lambda x: x.square)[: keep + 1]


def _late(time_s: Array, curve: _Curve, read: Akima1DInterpolator, delays_s: Array) -> Array:
    """Return the readings some delays (k,) before every row, (n, k); before the first instant, what was read there."""
    return np.asarray(read(np.maximum(time_s[:, None] - delays_s, curve.time_s[0])))


def _places(problem: FitProblem, rows: list[NDArray[np.intp]]) -> NDArray[np.intp]:
    """Return where rows of every record stand among the training rows of all of them."""
    found, before = [], 0
    for k, x in zip(rows, problem.observations, strict=True):
        training = np.flatnonzero(x.training)
        found.append(before + np.searchsorted(training, k))
        before += training.size
    return np.concatenate(found)
