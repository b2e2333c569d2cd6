"""An explanation that explains nothing waits for more rows, as long as some come."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bender_loop.records.record import Record, read_record
from bender_plant.model import load_model
from bender_watch.alarm.explain import Explanation, advice
from bender_watch.baseline.learn import Baseline, learn
from bender_watch.follow.rows import Rows
from bender_watch.settings import Settings
from bender_watch.watcher import Event, Watcher

MODEL = load_model("beam")
HOW = Settings(rows_between_false_alarms=1e5, explain_rows=100, adopt=False)
NOISE_UM = 0.05
CREEP = {"id": "creep", "title": "creep", "stage": "material", "grade": "certain", "probability": 0.9}


def explanation(left_um: float, rows: int, effects: tuple[dict[str, Any], ...] = ()) -> Explanation:
    return Explanation("named" if effects else "recalibrated", effects, {}, "", None, None, (), rows, left_um)


@pytest.mark.parametrize(
    ("left_um", "effects", "is_settled"),
    [
        (1.3 * NOISE_UM, (), False),
        (1.03 * NOISE_UM, (), True),
        (1.3 * NOISE_UM, (CREEP,), True),
        (1.03 * NOISE_UM, (CREEP | {"grade": "possible"},) * 2, False),
        (1.03 * NOISE_UM, (CREEP | {"grade": "possible"}, CREEP | {"grade": "likely"}), True),
        (math.nan, (), True),
    ],
)
def test_what_names_nothing_as_likely_beside_more_than_noise_or_others_is_no_explanation(
    left_um: float, effects: tuple[dict[str, Any], ...], *, is_settled: bool
) -> None:
    assert explanation(left_um, 1000, effects).is_settled(NOISE_UM) == is_settled


def test_a_calibration_beside_an_effect_that_the_rows_show_is_no_explanation() -> None:
    found = explanation(1.03 * NOISE_UM, 1000)
    assert not found.is_settled(NOISE_UM, suspected=True)
    assert explanation(1.03 * NOISE_UM, 1000, (CREEP,)).is_settled(NOISE_UM, suspected=True)


@pytest.mark.parametrize(("verdict", "told"), [("named", "the device's own material"), ("ambiguous", "record more")])
def test_what_cannot_be_told_apart_says_nowhere_to_look(verdict: str, told: str) -> None:
    assert [told in x for x in advice(verdict, ["creep", "thermal_drift"], None)] == [True]


@pytest.fixture(scope="module")
def baseline(device: Any) -> Baseline:
    return learn(MODEL, read_record(device.training), HOW.rows_between_false_alarms)


def watched(
    device: Any, baseline: Baseline, monkeypatch: pytest.MonkeyPatch, found: list[Explanation]
) -> tuple[list[int], list[Event]]:
    """Watch a gain that changes at row 600 of 1200; return the rows of each diagnosis, and the explanations."""
    rows: list[int] = []
    left = iter(found)

    def explained(_: Any, record: Record, since: int, *__: Any, **___: Any) -> Explanation:
        # the rows before the change lead to it, and are not read
        assert np.isfinite(record.displacement_um).sum() == since
        assert np.isfinite(record.displacement_um)[-since:].all()
        assert len(record) > since
        rows.append(since)
        return next(left)

    monkeypatch.setattr("bender_watch.watcher.explain", explained)
    record = read_record(device.write("changed.csv", 4, 1.05))
    watcher = Watcher(MODEL, record, baseline, HOW)
    parts = Rows.of(record)
    events = [*watcher.begin_record("own", parts), *watcher.take(parts), *watcher.finish()]
    return rows, [x for x in events if x["event"] == "explained"]


def test_it_waits_for_twice_the_rows_and_says_one_thing(
    device: Any, baseline: Baseline, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = [explanation(2.0 * NOISE_UM, 100), explanation(NOISE_UM, 200, (CREEP,))]
    rows, events = watched(device, baseline, monkeypatch, found)
    assert rows == [100, 200]
    assert [x["verdict"] for x in events] == ["named"]


def test_it_does_not_wait_for_ever(device: Any, baseline: Baseline, monkeypatch: pytest.MonkeyPatch) -> None:
    rows, events = watched(device, baseline, monkeypatch, [explanation(2.0 * NOISE_UM, 100)] * 9)
    assert rows == [100, 200, 400]
    assert [x["verdict"] for x in events] == ["recalibrated"]


@pytest.mark.parametrize("ramp", [0, 300])
def test_what_comes_in_slowly_is_diagnosed_where_all_of_it_is_there(
    device: Any, baseline: Baseline, monkeypatch: pytest.MonkeyPatch, ramp: int
) -> None:
    begins: list[tuple[float, int]] = []

    def explained(_: Any, record: Record, since: int, *__: Any, **___: Any) -> Explanation:
        begins.append((float(record.time_s[-since]), since))
        return explanation(NOISE_UM, since, (CREEP,))

    monkeypatch.setattr("bender_watch.watcher.explain", explained)
    record = read_record(device.write("ramp.csv", 4))
    part = np.clip((np.arange(len(record)) - 200) / max(ramp, 1), 0.0, 1.0)
    record = replace(record, displacement_um=record.displacement_um * (1.0 + 0.05 * part))
    watcher, parts = Watcher(MODEL, record, baseline, HOW), Rows.of(record)
    events = [*watcher.begin_record("own", parts), *watcher.take(parts)]
    (begin_s, rows), *_ = begins
    assert np.searchsorted(record.time_s, begin_s) == pytest.approx(200 + ramp, abs=60)
    assert rows >= HOW.explain_rows
    told = next(x for x in events if x["event"] == "explained")
    assert told["since"]["row_low"] <= 240
    assert told["size"]["shape"] == ("ramp" if ramp else "step")
    assert not told["size"]["grows"]
