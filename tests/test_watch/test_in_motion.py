"""A record that begins while the device moves: what came before it is unknown, and is no change of the device."""

import numpy as np
import pytest

from bender_compiled.simulation import Drive, Simulator
from bender_loop.records.record import Record
from bender_plant.model import load_model
from bender_watch.baseline.learn import Baseline, learn
from bender_watch.follow.rows import Rows
from bender_watch.settings import Settings
from bender_watch.watcher import Watcher

MODEL = load_model("paper")
HOW = Settings(rows_between_false_alarms=1e6, diagnose=False, explain_rows=1000)
BEFORE, TRAINED, ROWS = 600, 2000, 6000


def recorded(seed: int, rows: int, level_um: float = 0.0) -> Record:
    """Return two sines at 30 Hz of a device that has moved for 20 s, its level moved at row 3000."""
    rng = np.random.default_rng(seed)
    time, phases = np.arange(BEFORE + rows) / 30.0, rng.uniform(0.0, 2.0 * np.pi, 2)
    voltage = 15.0 * np.sin(1.2566 * time + phases[0]) + 8.0 * np.sin(3.3301 * time + phases[1])
    clean = Simulator(Drive.of_rows(time, voltage)).run(MODEL).reading_um[BEFORE:]
    read = clean + 0.05 * rng.standard_normal(rows) + np.where(np.arange(rows) < ROWS // 2, 0.0, level_um)
    return Record(time[:rows], voltage[BEFORE:], read)


@pytest.fixture(scope="module")
def known() -> tuple[Record, Baseline]:
    training = recorded(1, TRAINED)
    return training, learn(MODEL, training, HOW.rows_between_false_alarms)


def alarms(known: tuple[Record, Baseline], record: Record) -> list[int]:
    watcher, rows = Watcher(MODEL, *known, HOW), Rows.of(record)
    return [x["row"] for x in [*watcher.begin_record("own", rows), *watcher.take(rows)] if x["event"] == "alarm"]


@pytest.mark.parametrize("seed", range(2, 12))
def test_an_unknown_beginning_is_no_alarm(seed: int, known: tuple[Record, Baseline]) -> None:
    assert alarms(known, recorded(seed, ROWS)) == []


def test_a_level_that_moves_later_is_one(known: tuple[Record, Baseline]) -> None:
    (row,) = alarms(known, recorded(2, ROWS, 0.1))
    assert ROWS // 2 < row < ROWS // 2 + 60


def test_a_level_of_its_own_is_taken_for_the_records_own(known: tuple[Record, Baseline]) -> None:
    record = recorded(2, ROWS)
    moved = Record(record.time_s, record.voltage_V, record.displacement_um + 3.0)
    assert alarms(known, moved) == []
