"""Many short records of devices with memory, begun in motion or after a pause shorter than that memory.

Nobody knows what was before the first row. Half of the records of each device change in the middle: the gain by 5 %, or
the readings come one row late. Readings are as an ordinary bench has them: some lost, some outlying, in steps of their
noise, at times that are not quite even.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bender_compiled.simulation import Drive, Simulator
from bender_loop.records.record import Record
from bender_plant.model import Model, load_model
from bender_proving.bench import stream
from bender_studies.watching.trial import median
from bender_watch.baseline.learn import Baseline, learn
from bender_watch.follow.rows import Rows
from bender_watch.settings import Settings
from bender_watch.watcher import Watcher

BEGINS = ("in motion", "after a pause")
CHANGES = ("none", "gain 5 %", "one row late")
BEFORE, PAUSE, RATE_Hz = 1800, 90, 30.0
"""Rows of motion before a record, and of them how many at 0 V before one that begins after a pause."""
FEWEST, MOST, TRAINED = 2000, 6000, 4000
NOISE_um, UNEVEN, LOST, OUTLYING, OUTLIER = 0.05, 0.05, 0.01, 0.002, 20.0
"""Deviation and step of the readings, part of an interval, parts of the rows, and deviations."""
TONES = ((16.0, 0.2), (12.0, 0.53), (8.0, 1.37))


def devices() -> dict[str, Model]:
    """Return devices by what they remember."""
    beam, paper = load_model("beam"), load_model("paper")
    return {
        "eq. (30)": paper,
        "eq. (30), late": paper.with_block("transport_delay", delay_s=0.05),
        "creep": beam.with_block("creep", gains=(0.03, 0.03, 0.03), time_constants_s=(1.0, 10.0, 100.0)),
        "play": beam.with_block("backlash", half_width_um=1.5),
    }


@dataclass(frozen=True, slots=True)
class Short:
    """A short record that was watched.

    Attributes:
        device, begins, change: of it.
        rows, judged: how many, and on how many of them tests were held.
        false: an alarm before the change, or without one.
        delay: rows from the change to the alarm, None where there was none.
    """

    device: str
    begins: str
    change: str
    rows: int
    judged: int
    false: bool
    delay: int | None


def recorded(model: Model, begins: str, change: str, rows: int, seed: int) -> Record:
    """Return a record of a device that had moved for a minute."""
    rng = stream(seed, "short")
    count, before = BEFORE + rows, BEFORE
    time = (np.arange(count) + rng.uniform(-UNEVEN, UNEVEN, count)) / RATE_Hz
    phases = rng.uniform(0.0, 2.0 * np.pi, len(TONES))
    voltage = np.sum([a * np.sin(2.0 * np.pi * f * time + x) for (a, f), x in zip(TONES, phases, strict=True)], axis=0)
    if begins == "after a pause":
        voltage[before - PAUSE : before + 5] = 0.0
    read = Simulator(Drive.of_rows(time, voltage)).run(model).reading_um[before - 1 :]
    now, earlier, since = read[1:], read[:-1], np.arange(rows) >= rows // 2
    clean = np.where(since, {"none": now, "gain 5 %": 1.05 * now, "one row late": earlier}[change], now)
    measured = clean + NOISE_um * (rng.standard_normal(rows) + OUTLIER * (rng.random(rows) < OUTLYING))
    measured = np.where(rng.random(rows) < LOST, np.nan, NOISE_um * np.round(measured / NOISE_um))
    return Record(time[before:], voltage[before:], measured)


def watched(records: int, every: float, seed: int, said: Callable[[str], None]) -> Iterator[Short]:
    """Watch so many records of each device and beginning.

    Args:
        records: of each, half of them without a change.
        every: rows between two false alarms, of each watch.
        seed: of the draws.
        said: is told which device is watched.
    """
    how = Settings(rows_between_false_alarms=every, diagnose=False)
    for number, (name, model) in enumerate(devices().items() if records else ()):
        said(name)
        training = recorded(model, BEGINS[0], CHANGES[0], TRAINED, seed + 1000 * number)
        known = training, learn(model, training, every)
        for k in range(2 * records):
            begins, change = BEGINS[k % 2], (*CHANGES, CHANGES[0])[k // 2 % 4]
            own = seed + 1000 * number + 1 + k
            rows = int(stream(own, "short, rows").integers(FEWEST, MOST))
            yield _watched(model, known, recorded(model, begins, change, rows, own), (name, begins, change), how)


def _watched(
    model: Model, known: tuple[Record, Baseline], record: Record, what: tuple[str, str, str], how: Settings
) -> Short:
    watcher, rows = Watcher(model, *known, how), Rows.of(record)
    events = [*watcher.begin_record("short", rows), *watcher.take(rows)]
    alarms = [x["row"] - 1 for x in events if x["event"] == "alarm"]
    since = len(record) // 2 if what[2] != CHANGES[0] else len(record)
    after = [x - since + 1 for x in alarms if x >= since]
    return Short(*what, watcher.rows, watcher.judged, any(x < since for x in alarms), after[0] if after else None)


def table_of_short(found: Sequence[Short]) -> tuple[list[str], list[list[Any]]]:
    """Return columns and rows: false alarms, and how late changes are found, by device and beginning."""
    columns = ["device", "begins", "records", "rows", "judged", "with a false alarm"]
    for change in CHANGES[1:]:
        columns += [f"{change}: found", f"{change}: median delay"]
    rows: list[list[Any]] = []
    for device, begins in dict.fromkeys((x.device, x.begins) for x in found):
        own = [x for x in found if (x.device, x.begins) == (device, begins)]
        sums = [sum(getattr(x, what) for x in own) for what in ("rows", "judged", "false")]
        row = [device, begins, len(own), *sums]
        for change in CHANGES[1:]:
            delays = [x.delay for x in own if x.change == change]
            middle = median(delays)
            row.append(f"{sum(x is not None for x in delays)} of {len(delays)}")
            row.append(middle if np.isfinite(middle) else "never")
        rows.append(row)
    return columns, rows
