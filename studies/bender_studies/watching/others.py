"""Detectors side by side: what each makes of a run, and where it alarms at a threshold.

| name | what it is |
|---|---|
| watch | all tests of `bender watch`; the threshold is a factor on all of its thresholds |
| moving window | the mean of the last 64 innovations, in its own deviation |
| Kalman innovations | the sum of the squares of the last 64 innovations (Mehra and Peschon 1971) |
| Page-Hinkley (river) | the two-sided one of river, with an allowance of 0.05 (Page 1954) |
| ADWIN (river) | the one of river; the threshold is -ln of its delta (Bifet and Gavalda 2007) |
| ruptures | every 64 rows, the best cut of the last 512: by how much it lowers the sum of squares |

All but the watch see one column: the whitened residual of the model.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record
from bender_watch.baseline.learn import Baseline
from bender_watch.sequential.detector import JUDGED, Detector

Array = NDArray[np.float64]

WINDOW = 64
BATCHED = 512
SHORTEST = 4
"""Rows on either side of a cut of ruptures."""
ALLOWANCE = 0.05
OUT_OF_REACH = 1e6
"""Factor on thresholds that nothing exceeds."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A record beside what is expected of it.

    Attributes:
        baseline: what is normal.
        residual_um: (n,) measured minus expected.
        signatures_um: (n, j) of unit size.
        spread: (n,) factor on the deviation of the noise.
        innovations: (n,) whitened residual.
        tops: (n,) largest statistic of the watch over its threshold.
    """

    baseline: Baseline
    residual_um: Array
    signatures_um: Array
    spread: Array
    innovations: Array
    tops: Array

    def since(self, row: int) -> "Run":
        """Return the rows from one on, as if the run began there."""
        part = slice(row, None)
        return judged_run(self.baseline, self.residual_um[part], self.signatures_um[part], self.spread[part])


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """What is expected of the commands of a record, whatever is read."""

    baseline: Baseline
    expected_um: Array
    signatures_um: Array
    spread: Array

    @classmethod
    def of(cls, baseline: Baseline, record: Record) -> "Expected":
        """Drive the model with the commands of a record that begins at rest."""
        baseline.expectation.begin(float(record.time_s[0]), float(record.voltage_V[0]), rest=True)
        expected, raw = baseline.expectation.advance(record.time_s, record.voltage_V, record.command_time_s)
        steps = np.diff(record.time_s, prepend=2.0 * record.time_s[0] - record.time_s[1])
        spread = baseline.spread(expected, float(expected[0]), steps)
        return cls(baseline, expected, baseline.signatures_um(expected, raw), spread)

    def run(self, measured_um: Array) -> Run:
        """Return the run in which this was read (n,)."""
        residual_um = self.baseline.residual_um(measured_um, self.expected_um)
        return judged_run(self.baseline, residual_um, self.signatures_um, self.spread)


def judged_run(baseline: Baseline, residual_um: Array, signatures_um: Array, spread: Array) -> Run:
    """Return a run with the statistics of the watch at every row, none of which ends it."""
    tests = baseline.tests.scaled(OUT_OF_REACH)
    kinds = np.full(residual_um.size, JUDGED, dtype=np.int64)
    found = Detector(baseline.noise, tests).judge(residual_um, signatures_um, kinds, spread)
    return Run(baseline, residual_um, signatures_um, spread, found.innovations, OUT_OF_REACH * found.tops)


class Method(Protocol):
    """A detector: what it makes of a run whatever its threshold, and where it alarms."""

    def prepared(self, run: Run) -> Any:
        """Return what is computed once of a run."""
        ...

    def first(self, prepared: Any, threshold: float) -> int | None:
        """Return the row of the first alarm, None where there is none."""
        ...


@dataclass(frozen=True, slots=True)
class Statistic:
    """A detector whose statistic does not depend on its threshold."""

    of: Callable[[Run], Array]

    def prepared(self, run: Run) -> Array:
        """Return the largest statistic so far (n,)."""
        return np.maximum.accumulate(self.of(run))

    def first(self, prepared: Array, threshold: float) -> int | None:
        """Return the first row beyond the threshold."""
        row = int(np.searchsorted(prepared, threshold, side="right"))
        return row if row < prepared.size else None


@dataclass(frozen=True, slots=True)
class River:
    """A detector of river, by its threshold."""

    made: Callable[[float], Any]

    def prepared(self, run: Run) -> list[float]:
        """Return the innovations as plain numbers."""
        return run.innovations.tolist()

    def first(self, prepared: Sequence[float], threshold: float) -> int | None:
        """Return the first row at which it sees a drift."""
        detector = self.made(threshold)
        for row, value in enumerate(prepared):
            detector.update(value)
            if detector.drift_detected:
                return row
        return None


def moving_window(run: Run) -> Array:
    """Return the mean of the last rows (n,), in its own deviation; 0 before there are enough."""
    return np.abs(_windows(run.innovations)) / math.sqrt(WINDOW)


def kalman_innovations(run: Run) -> Array:
    """Return the sum of squares of the last rows (n,), in its own deviation; 0 before there are enough."""
    sums = _windows(run.innovations**2)
    return np.where(sums > 0.0, sums - WINDOW, 0.0) / math.sqrt(2.0 * WINDOW)


def _windows(values: Array) -> Array:
    sums = np.convolve(values, np.ones(WINDOW))[: values.size]
    sums[: WINDOW - 1] = 0.0
    return sums


def best_cut(run: Run) -> Array:
    """Return by how much the best cut of the last rows lowers their sum of squares (n,); 0 between batches."""
    e, found = run.innovations, np.zeros(run.innovations.size)
    search = import_module("ruptures").KernelCPD(kernel="linear", min_size=SHORTEST)
    for end in range(2 * WINDOW, e.size + 1, WINDOW):
        rows = e[max(0, end - BATCHED) : end]
        cut, count = search.fit(rows).predict(n_bkps=1)
        apart = float(np.mean(rows[:cut]) - np.mean(rows[cut:]))
        found[end - 1] = apart * apart * cut * (count - cut) / count
    return found


def _page_hinkley(threshold: float) -> Any:
    return import_module("river.drift").PageHinkley(delta=ALLOWANCE, threshold=threshold)


def _adwin(threshold: float) -> Any:
    return import_module("river.drift").ADWIN(delta=math.exp(-threshold))


METHODS: dict[str, tuple[Method, str | None]] = {
    "watch": (Statistic(lambda run: run.tops), None),
    "moving window": (Statistic(moving_window), None),
    "Kalman innovations": (Statistic(kalman_innovations), None),
    "Page-Hinkley (river)": (River(_page_hinkley), "river"),
    "ADWIN (river)": (River(_adwin), "river"),
    "ruptures": (Statistic(best_cut), "ruptures"),
}
"""By name, with the library that it needs."""


def missing(name: str) -> str | None:
    """Return the library of a method that is not installed, None where all is there."""
    library = METHODS[name][1]
    return None if library is None or find_spec(library) else library
