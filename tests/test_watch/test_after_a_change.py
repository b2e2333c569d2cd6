"""What has changed once is normal from then on: one change is one alarm, whatever it was."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from bender_compiled.simulation import Drive, Simulator
from bender_loop.records.record import Record
from bender_plant.model import load_model
from bender_watch.baseline.learn import Baseline, learn
from bender_watch.follow.rows import Rows
from bender_watch.settings import Settings
from bender_watch.watcher import Watcher

Array = NDArray[np.float64]

MODEL = load_model("beam")
HOW = Settings(rows_between_false_alarms=1e6, diagnose=False, explain_rows=1000)
AT, ROWS = 2000, 16_000


def recorded(seed: int, rows: int, changed: Callable[[Array, Array], Array] | None = None) -> Record:
    """Return steps at 50 Hz whose reading is another one from row 2000 on, by reading and noise of 0.05 um."""
    rng = np.random.default_rng(seed)
    time = np.arange(rows) / 50.0
    voltage = np.repeat(np.append(0.0, rng.uniform(0.0, 30.0, rows // 30)), 30)[:rows]
    clean = Simulator(Drive.of_rows(time, voltage)).run(MODEL).reading_um
    noise = 0.05 * rng.standard_normal(rows)
    read = clean + noise
    if changed is not None:
        read[AT:] = changed(clean, noise)[AT:]
    return Record(time, voltage, read)


@pytest.fixture(scope="module")
def known() -> tuple[Record, Baseline]:
    training = recorded(1, 3000)
    return training, learn(MODEL, training, HOW.rows_between_false_alarms)


CHANGES: dict[str, Callable[[Array, Array], Array]] = {
    "gain": lambda clean, noise: 1.05 * clean + noise,
    "offset": lambda clean, noise: clean + 0.3 + noise,
    "louder": lambda clean, noise: clean + 2.0 * noise,
    "quieter": lambda clean, noise: clean + 0.4 * noise,
    "hum": lambda clean, noise: clean + noise + 0.1 * np.sin(1.3 * np.arange(clean.size)),
    "coloured": lambda clean, noise: clean + np.convolve(noise, 0.7 ** np.arange(20))[: clean.size],
}


@pytest.mark.parametrize("change", CHANGES)
def test_one_change_is_one_alarm(change: str, known: tuple[Record, Baseline]) -> None:
    watcher, rows = Watcher(MODEL, *known, HOW), Rows.of(recorded(7, ROWS, CHANGES[change]))
    events = [*watcher.begin_record("own", rows), *watcher.take(rows)]
    assert [x["event"] for x in events if x["event"] != "trend"] == ["record", "alarm", "explained"]
    assert AT < events[1]["row"] < AT + 100
    assert events[2]["goes_on"] == "with the rows since then as normal"


def test_a_second_change_is_a_second_alarm(known: tuple[Record, Baseline]) -> None:
    record = recorded(7, ROWS, CHANGES["louder"])
    record = replace(record, displacement_um=record.displacement_um + np.where(np.arange(ROWS) < 9000, 0.0, 0.3))
    watcher, rows = Watcher(MODEL, *known, HOW), Rows.of(record)
    events = [*watcher.begin_record("own", rows), *watcher.take(rows)]
    alarms = [x["row"] for x in events if x["event"] == "alarm"]
    assert len(alarms) == 2
    assert 9000 < alarms[1] < 9200
