"""However rows arrive, one by one or all at once, the same is said of them, to the last digit."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bender_compiled.simulation import Drive, Simulator
from bender_loop.records.record import Record
from bender_plant.model import load_model
from bender_watch.baseline.learn import Baseline, learn
from bender_watch.follow.rows import Rows
from bender_watch.session import finite
from bender_watch.settings import Settings
from bender_watch.watcher import Watcher

MODEL = load_model("paper")
HOW = Settings(rows_between_false_alarms=1e5, diagnose=False, explain_rows=1000)
ROWS, AT, RATE_Hz, NOISE_um = 6000, 2500, 30.0, 0.05


def recorded(seed: int, rows: int, change: float = 1.0) -> Record:
    """Return a record that begins in motion, whose gain is another one from row 2500 on; some readings are lost."""
    rng = np.random.default_rng(seed)
    time = np.arange(rows) / RATE_Hz
    voltage = 25.0 + 15.0 * np.sin(1.3 * time) + 9.0 * np.sin(4.1 * time)
    clean = Simulator(Drive.of_rows(time, voltage)).run(MODEL).reading_um
    read = np.where(np.arange(rows) < AT, 1.0, change) * clean + NOISE_um * rng.standard_normal(rows)
    return Record(time, voltage, np.where(rng.random(rows) < 0.01, np.nan, read))


@pytest.fixture(scope="module")
def known() -> tuple[Record, Baseline]:
    training = recorded(1, 2500)
    return training, learn(MODEL, training, HOW.rows_between_false_alarms)


@pytest.fixture(scope="module")
def changing() -> Rows:
    return Rows.of(recorded(2, ROWS, 1.05))


@pytest.fixture(scope="module")
def whole(known: tuple[Record, Baseline], changing: Rows) -> list[dict[str, Any]]:
    said = watched(known, changing, [])
    assert [x["event"] for x in said if x["event"] != "trend"] == ["record", "alarm", "explained"]
    return said


def watched(known: tuple[Record, Baseline], rows: Rows, cuts: list[int]) -> list[dict[str, Any]]:
    """Return what is said of rows that arrive in parts."""
    watcher = Watcher(MODEL, *known, HOW)
    events = list(watcher.begin_record("own", rows))
    ends = sorted({*cuts, len(rows)})
    for begin, end in zip([0, *ends[:-1]], ends, strict=True):
        events += watcher.take(rows.part(slice(begin, end)))
    return finite([*events, *watcher.finish()])


@settings(max_examples=3, deadline=None)
@given(cuts=st.lists(st.integers(1, ROWS - 1), max_size=12))
def test_what_is_said_does_not_depend_on_how_rows_arrive(
    cuts: list[int], known: tuple[Record, Baseline], changing: Rows, whole: list[dict[str, Any]]
) -> None:
    assert watched(known, changing, cuts) == whole
