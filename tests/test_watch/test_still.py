"""A sensor that is dead is no effect of the device: it is said at the alarm, and nothing is learned from it."""

import json
from typing import Any

import numpy as np
import pytest

from bender_compiled.simulation import Drive, Simulator
from bender_loop.records.record import Record
from bender_plant.model import load_model
from bender_watch.alarm.still import ADVICE, NO_READING, is_still, silent_after
from bender_watch.baseline.learn import Baseline, learn
from bender_watch.follow.rows import Rows
from bender_watch.session import finite
from bender_watch.settings import Settings
from bender_watch.watcher import Watcher
from bender_watch.words import sentence

MODEL = load_model("beam")
HOW = Settings(rows_between_false_alarms=1e6, explain_rows=1000)
ROWS, RATE_Hz, NOISE_um, DEAD, BACK = 6000, 30.0, 0.05, slice(1500, 4500), 4500


def recorded(seed: int, rows: int = ROWS) -> Record:
    rng = np.random.default_rng(seed)
    time = np.arange(rows) / RATE_Hz
    voltage = 20.0 * np.sin(1.3 * time) + 10.0 * np.sin(4.1 * time)
    clean = Simulator(Drive.of_rows(time, voltage)).run(MODEL).reading_um
    return Record(time, voltage, clean + NOISE_um * rng.standard_normal(rows))


@pytest.fixture(scope="module")
def known() -> tuple[Record, Baseline]:
    training = recorded(1, 2000)
    return training, learn(MODEL, training, HOW.rows_between_false_alarms)


def dead(kind: str) -> Record:
    """Return a record whose sensor is dead for 3000 rows in the middle."""
    record, rng = recorded(2), np.random.default_rng(3)
    read = record.displacement_um.copy()
    rows = DEAD.stop - DEAD.start
    read[DEAD] = {
        "held": np.full(rows, read[DEAD.start]),
        "noise": 1.0 + NOISE_um * rng.standard_normal(rows),
        "nothing": np.full(rows, np.nan),
    }[kind]
    return Record(record.time_s, record.voltage_V, read)


def watched(known: tuple[Record, Baseline], record: Record, at_once: int = ROWS) -> list[dict[str, Any]]:
    watcher, rows = Watcher(MODEL, *known, HOW), Rows.of(record)
    events = list(watcher.begin_record("own", rows))
    for begin in range(0, len(record), at_once):
        events += watcher.take(rows.part(slice(begin, begin + at_once)))
        # what is remembered goes on as JSON has it
        facts, arrays = watcher.state()
        watcher.restore(json.loads(json.dumps(finite(facts))), arrays)
    return [*events, *watcher.finish()]


def test_a_held_reading_is_told_at_the_alarm(known: tuple[Record, Baseline]) -> None:
    events = watched(known, dead("held"))
    (alarm,) = [x for x in events if x["event"] == "alarm"]
    assert DEAD.start < alarm["row"] < DEAD.start + 20
    assert alarm["advice"] == [ADVICE]
    assert alarm["suspects"] == []
    assert ADVICE in sentence(alarm)


@pytest.mark.parametrize("kind", ["held", "noise"])
def test_nothing_is_learned_from_a_dead_sensor(kind: str, known: tuple[Record, Baseline]) -> None:
    events = watched(known, dead(kind))
    names = [x["event"] for x in events if x["event"] in ("alarm", "explained", "moves_again")]
    assert names == ["alarm", "explained", "moves_again"]
    (explained,) = [x for x in events if x["event"] == "explained"]
    assert explained["advice"] == [ADVICE]
    assert explained["effects"] == []
    (moves,) = [x for x in events if x["event"] == "moves_again"]
    assert BACK <= moves["row"] <= BACK + 1100
    assert "as before" in sentence(moves)


def test_no_reading_at_all_is_one_alarm(known: tuple[Record, Baseline]) -> None:
    (alarm,) = [x for x in watched(known, dead("nothing")) if x["event"] == "alarm"]
    assert alarm["test"] == "silence"
    assert alarm["row"] == DEAD.start + 64
    assert alarm["since"]["row"] == DEAD.start + 1
    assert NO_READING in sentence(alarm)


@pytest.mark.parametrize("kind", ["held", "noise", "nothing"])
def test_what_is_said_does_not_depend_on_how_rows_arrive(kind: str, known: tuple[Record, Baseline]) -> None:
    record = dead(kind)
    assert finite(watched(known, record, 700)) == finite(watched(known, record))


def test_play_that_stands_after_a_reversal_is_not_dead() -> None:
    rng, time = np.random.default_rng(4), np.arange(6.0)
    expected = np.asarray(20.0 + 0.5 * time, dtype=np.float64)
    assert not is_still(20.0 + NOISE_um * rng.standard_normal(6), expected, NOISE_um, 40.0, 0.0)
    assert is_still(np.full(6, 20.0), expected, NOISE_um, 40.0, 0.0)
    # readings in coarse steps repeat by themselves
    assert not is_still(np.full(6, 20.0), expected, NOISE_um, 40.0, 0.5)
    assert not is_still(np.negative(expected), expected, NOISE_um, 4.0, 0.0)


def test_losses_as_long_as_those_of_the_training_record_are_no_alarm() -> None:
    read = np.zeros(500)
    assert silent_after(read) == 64
    read[100:130] = np.nan
    assert silent_after(read) == 120


def shaken(seed: int, rows: int) -> Record:
    """Return a record of a device that is shaken for 1500 rows and stands then; shaken it is not quite its model."""
    rng, time = np.random.default_rng(seed), np.arange(rows) / RATE_Hz
    voltage = np.where(time < 1500 / RATE_Hz, 20.0 * np.sin(1.3 * time) + 10.0 * np.sin(4.1 * time), 0.0)
    clean = Simulator(Drive.of_rows(time, voltage)).run(MODEL).reading_um
    astray = 0.3 * rng.standard_normal(rows) * (np.abs(voltage) > 0.0)
    return Record(time, voltage, clean + astray + 0.01 * rng.standard_normal(rows))


def test_a_device_that_stands_for_longer_than_in_its_training_record_is_no_quieter_one() -> None:
    training = shaken(1, 3000)
    known = training, learn(MODEL, training, HOW.rows_between_false_alarms)
    events = watched(known, shaken(2, 12_000), 12_000)
    assert not [x for x in events if x["event"] == "alarm"]
