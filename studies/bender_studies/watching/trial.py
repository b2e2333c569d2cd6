"""One device watched, and what the optimal test would have done that knows the change and not its time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record
from bender_plant.model import Model
from bender_proving.cases.hidden import NOISE_UM
from bender_studies.watching.devices import SENSOR, Change
from bender_studies.watching.others import OTHERS
from bender_watch.baseline.learn import Baseline
from bender_watch.follow.rows import Rows
from bender_watch.settings import Settings
from bender_watch.watcher import Watcher

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Trial:
    """What a watch made of a change.

    Attributes:
        effect, size, shape: of the change.
        optimal_rows: delay of the optimal test; None where it does not find the change.
        rows: delay of the watch; None where it does not.
        early: it alarmed before the change.
        suspected: the effects that the alarm suspects first, once it is explained.
        named: the effects of the diagnosis, the first first; () without one.
        other_rows: delay of other detectors, None where one does not find it or alarmed before.
    """

    effect: str
    size: float
    shape: str
    optimal_rows: int | None
    rows: int | None
    early: bool
    suspected: tuple[str, ...]
    named: tuple[str, ...]
    other_rows: dict[str, int | None] = field(default_factory=dict)


def quiet_residual(baseline: Baseline, record: Record) -> Array:
    """Return the residual of a record in deviations of the noise."""
    baseline.expectation.begin(float(record.time_s[0]), 0.0, rest=True)
    expected, _ = baseline.expectation.advance(record.time_s, record.voltage_V, record.command_time_s)
    return baseline.residual_um(record.displacement_um, expected) / baseline.noise_um


def optimal_row(change: Change, rows_between_false_alarms: float) -> int | None:
    """Return the row at which the CUSUM of the true log-likelihood ratio exceeds ln(rows between false alarms).

    At that threshold its mean time between false alarms is at least that many rows, and none that knows as much has a
    shorter delay (Lorden 1971, Moustakides 1986). Of a step it knows what the effect would add at every row; of a ramp
    it knows the ramp as well, from the row on where it begins.
    """
    noise = NOISE_UM[SENSOR]
    known = change.added_um / noise
    clean_e = change.noise_um / noise
    total = 0.0
    for k in range(change.row, known.size):
        total = max(0.0, total + known[k] * (clean_e[k] + known[k]) - 0.5 * known[k] ** 2)
        if total >= math.log(rows_between_false_alarms):
            return k
    return None


def judged(
    model: Model, training: Record, baseline: Baseline, change: Change, how: Settings, others: dict[str, float]
) -> Trial:
    """Watch a device that changes."""
    watcher = Watcher(model, training, baseline, how)
    rows = Rows.of(change.record)
    events = [*watcher.begin_record("changed", rows), *watcher.take(rows), *watcher.finish()]
    alarms = [x["row"] - 1 for x in events if x["event"] == "alarm"]
    first = next((x for x in alarms if x >= change.row), None)
    told = next((x for x in events if x["event"] == "explained"), {"suspects": []})
    suspected = tuple(told["suspects"][0]["effects"]) if told["suspects"] else ()
    named = tuple(x["id"] for x in told.get("effects", ()))
    optimal = optimal_row(change, how.rows_between_false_alarms)
    e = quiet_residual(baseline, change.record)
    return Trial(
        change.effect,
        change.size,
        change.shape,
        None if optimal is None else optimal - change.row + 1,
        None if first is None else first - change.row + 1,
        any(x < change.row for x in alarms),
        suspected,
        named,
        {name: _delay(OTHERS[name](e, threshold), change.row) for name, threshold in others.items()},
    )


def _delay(row: int, change: int) -> int | None:
    return None if row < change else row - change + 1


def median(values: Sequence[float | None]) -> float:
    """Return the median of delays, where those that never end count as longer than all."""
    return float(np.median([math.inf if x is None else x for x in values])) if values else math.nan
