"""Detectors side by side: the statistic that each makes of a run, and where it alarms at a threshold.

| name | what it is |
|---|---|
| watch | all tests of `bender watch`; the threshold is a factor on all of its thresholds |
| moving window | the mean of the last 64 innovations, in its own deviation |
| Kalman innovations | the sum of the squares of the last 64 innovations (Mehra and Peschon 1971) |
| Page-Hinkley | two-sided, with river's numbers (Page 1954) |
| ADWIN | with river's numbers; the threshold is -ln of its delta (Bifet and Gavalda 2007) |
| best cut | every 64 rows, by how much the best cut of the last 512 lowers the sum of squares: ruptures with one cut |

All but the watch see one column: the whitened residual of the model. No statistic depends on its threshold, so that one
pass over a run says where each threshold would alarm.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record
from bender_watch.baseline.learn import Baseline
from bender_watch.sequential.detector import JUDGED, Detector

Array = NDArray[np.float64]

WINDOW = 64
BATCHED = 512
SHORTEST = 4
"""Rows on either side of a cut."""
ALLOWANCE, FADING, FEWEST = 0.05, 0.9999, 30
"""Of Page-Hinkley: off each step of the sums, part of them that stays, and rows before which nothing is said."""
LOOKED_AT, BUCKETS = 32, 5
"""Of ADWIN: rows from one look to the next, and buckets of one length."""
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


Method = Callable[[Run], Array]
"""Returns the statistic of a run (n,)."""


def largest(method: Method, run: Run) -> Array:
    """Return the largest statistic so far (n,)."""
    return np.maximum.accumulate(method(run))


def first_beyond(statistic: Array, threshold: float) -> int | None:
    """Return the row at which the largest statistic so far (n,) first exceeds a threshold, None where it does not."""
    row = int(np.searchsorted(statistic, threshold, side="right"))
    return row if row < statistic.size else None


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
    for end in range(2 * WINDOW, e.size + 1, WINDOW):
        rows = e[max(0, end - BATCHED) : end]
        cuts = np.arange(SHORTEST, rows.size - SHORTEST + 1)
        apart = np.cumsum(rows)[cuts - 1] - cuts * rows.mean()
        found[end - 1] = float(np.max(apart**2 * rows.size / (cuts * (rows.size - cuts))))
    return found


def page_hinkley(run: Run) -> Array:
    """Return the larger of both sums beyond its extreme (n,)."""
    found, up, down, least, most, mean = np.zeros(run.innovations.size), 0.0, 0.0, math.inf, -math.inf, 0.0
    for k, value in enumerate(run.innovations.tolist()):
        mean += (value - mean) / (k + 1)
        up = FADING * up + value - mean - ALLOWANCE
        down = FADING * down + value - mean + ALLOWANCE
        least, most = min(least, up), max(most, down)
        found[k] = max(up - least, most - down) if k + 1 >= FEWEST else 0.0
    return found


def adwin(run: Run) -> Array:
    """Return the largest -ln delta at which a cut of the window at one of its buckets is a change (n,)."""
    e = run.innovations
    found, sums, squares = np.zeros(e.size), np.append(0.0, np.cumsum(e)), np.append(0.0, np.cumsum(e**2))
    for n in range(LOOKED_AT, e.size + 1, LOOKED_AT):
        old = _buckets(n)
        old = old[(old > SHORTEST) & (n - old > SHORTEST + 1)]
        narrow = 1.0 / (old - SHORTEST) + 1.0 / (n - old - SHORTEST)
        apart = np.abs(sums[old] / old - (sums[n] - sums[old]) / (n - old))
        variance = squares[n] / n - (sums[n] / n) ** 2
        # apart = sqrt(2 narrow variance x) + 2 narrow x / 3 by x = ln(2 ln(n) / delta)
        linear, square = np.sqrt(2.0 * narrow * variance), 2.0 * narrow / 3.0
        root = (np.sqrt(linear**2 + 4.0 * square * apart) - linear) / (2.0 * square)
        found[n - 1] = max(0.0, float(np.max(root**2, initial=0.0)) - math.log(2.0 * math.log(n)))
    return found


@cache
def _buckets(rows: int) -> NDArray[np.int64]:
    """Return where the buckets of a window of so many rows end, from the oldest row on."""
    counts = [0]
    for _ in range(rows):
        counts[0] += 1
        for k in range(len(counts)):
            if counts[k] <= BUCKETS:
                break
            counts += [0] * (k + 1 == len(counts))
            counts[k], counts[k + 1] = counts[k] - 2, counts[k + 1] + 1
    lengths = [2**k for k in reversed(range(len(counts))) for _ in range(counts[k])]
    return np.cumsum(lengths)


METHODS: dict[str, Method] = {
    "watch": lambda run: run.tops,
    "moving window": moving_window,
    "Kalman innovations": kalman_innovations,
    "Page-Hinkley": page_hinkley,
    "ADWIN": adwin,
    "best cut": best_cut,
}
