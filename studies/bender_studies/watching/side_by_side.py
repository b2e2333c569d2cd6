"""Detectors at equal false alarms: thresholds from each one's own run length, then delays on the same changed runs.

A run is a record as long as the changed ones; it ends at its first alarm. Alarms over the rows until then are the rate
of false alarms. Each threshold is the one at which that rate is the wanted one on runs without a change; the rate is
counted again on other runs, that no threshold has seen.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_proving.bench import stream
from bender_proving.cases.hidden import NOISE_UM
from bender_studies.watching.devices import SENSOR, Change, Quiet
from bender_studies.watching.others import METHODS, Expected, Method, Run, first_beyond, largest
from bender_studies.watching.trial import median
from bender_watch.baseline.learn import Baseline
from bender_watch.sequential.detector import JUDGED, Detector

Array = NDArray[np.float64]

HALVINGS = 16
LOW, HIGH = 0.05, 2000.0
"""Between which every threshold is sought."""


@dataclass(frozen=True, slots=True)
class Counted:
    """Alarms over rows, with the interval of 95 % of the rows from one to the next."""

    alarms: int
    rows: int
    low: float
    high: float

    @classmethod
    def of(cls, alarms: int, rows: int) -> "Counted":
        """Count (Garwood 1936)."""
        from scipy.stats import chi2

        most = float(chi2.ppf(0.975, 2 * alarms + 2)) / 2.0
        least = float(chi2.ppf(0.025, 2 * alarms)) / 2.0 if alarms else 0.0
        return cls(alarms, rows, rows / most, rows / least if least else math.inf)


@dataclass(frozen=True, slots=True)
class Beside:
    """A method beside the others.

    Attributes:
        name: of the method.
        threshold: at which its false alarms are as rare as wanted.
        counted: its false alarms on runs that the threshold has not seen.
        delays: in rows by size of the change, None for a change that is not found.
    """

    name: str
    threshold: float
    counted: Counted
    delays: dict[float, list[int | None]]


def quiet_runs(baseline: Baseline, devices: Sequence[Quiet], rows: float, seed: int) -> Iterator[Run]:
    """Yield runs of devices that do not change, in turn and each with noise of its own, until there are enough rows."""
    expected = [Expected.of(baseline, x.record(seed)) for x in devices]
    count = math.ceil(rows / devices[0].clean_um.size)
    for k in range(count):
        place = k % len(devices)
        yield expected[place].run(devices[place].record(seed + k).displacement_um)


def alarms_without_end(expected: Expected, device: Quiet, rows: float, seed: int) -> tuple[int, int]:
    """Return the alarms of the tests of a baseline over one record without an end, and its rows.

    The plan of a device that does not change comes again and again, each time with other noise.
    """
    base, size = expected.baseline, device.clean_um.size
    clean_um = base.residual_um(device.clean_um, expected.expected_um)
    rng, detector = stream(seed, "without an end"), Detector(base.noise, base.tests)
    kinds = np.full(size, JUDGED, dtype=np.int64)
    alarms = seen = 0
    while seen < rows:
        residual_um = clean_um + NOISE_UM[SENSOR] * rng.standard_normal(size)
        begin = 0
        while begin < size:
            found = detector.judge(residual_um, expected.signatures_um, kinds, expected.spread, begin).exceedance
            if found is None:
                break
            alarms, begin = alarms + 1, found.row + 1
            detector.reset()
        seen += size
    return alarms, seen


def counted(statistics: Sequence[Array], threshold: float) -> tuple[int, int]:
    """Return the alarms on runs that end at the first one, and the rows until then."""
    firsts = [first_beyond(x, threshold) for x in statistics]
    rows = sum(x.size if first is None else first + 1 for first, x in zip(firsts, statistics, strict=True))
    return sum(x is not None for x in firsts), rows


def threshold_of(statistics: Sequence[Array], every: float) -> float:
    """Return the lowest threshold at which a method raises no more than one alarm in so many rows."""
    low, high = LOW, HIGH
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        alarms, rows = counted(statistics, middle)
        low, high = (middle, high) if alarms * every > rows else (low, middle)
    return high


def delay(method: Method, run: Run, row: int, threshold: float) -> int | None:
    """Return how many rows after a change a method finds it; after a false alarm before, it begins anew."""
    begin = 0
    while True:
        first = first_beyond(largest(method, run.since(begin)), threshold)
        if first is None:
            return None
        if begin + first >= row:
            return begin + first - row + 1
        begin += first + 1


def side_by_side(
    calm: Sequence[Run], other: Sequence[Run], changed: Sequence[tuple[Change, Run]], every: float,
    said: Callable[[str], None] = lambda _: None,
) -> list[Beside]:  # fmt: skip
    """Return every method with its threshold, its false alarms and its delays.

    Args:
        calm: runs without a change that thresholds are set on.
        other: runs without a change on which false alarms are counted.
        changed: changes, and their runs.
        every: rows from one false alarm to the next, in the mean.
        said: is told which method is at work.
    """
    found = []
    for name, method in METHODS.items():
        said(name)
        threshold = threshold_of([largest(method, x) for x in calm], every)
        fresh = counted([largest(method, x) for x in other], threshold)
        delays: dict[float, list[int | None]] = {}
        for change, run in changed:
            delays.setdefault(change.size, []).append(delay(method, run, change.row, threshold))
        found.append(Beside(name, threshold, Counted.of(*fresh), delays))
    return found


def table(found: Sequence[Beside], sizes: Sequence[float]) -> tuple[list[str], list[list[Any]]]:
    """Return columns and rows: a method, its false alarms, its median delays and how many changes it found."""
    columns = ["method", "threshold", "false alarms", "one in rows (95 %)"]
    for size in sizes:
        columns += [f"{size:g} × noise: median delay", f"{size:g} × noise: found"]
    rows: list[list[Any]] = []
    for one in found:
        count = one.counted
        row: list[Any] = [one.name, one.threshold, count.alarms, f"{count.low:.0f} to {count.high:.0f}"]
        for size in sizes:
            own = one.delays.get(size, [])
            middle = median(own)
            row += [middle if np.isfinite(middle) else "never", f"{sum(x is not None for x in own)} of {len(own)}"]
        rows.append(row)
    return columns, rows
