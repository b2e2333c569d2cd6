"""What a watch writes into the folder of a run, and that the page of the run draws it."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bender_cli.main import main
from bender_hil.live.page import Shown, charts, facts
from bender_hil.log.read_run import GUARD, RUN
from bender_loop.records.record import read_record
from bender_plant.model import load_model
from bender_watch.baseline.expectation import OfModel
from bender_watch.baseline.learn import learn
from bender_watch.beside_run import BesideRun
from bender_watch.follow.heading import Naming
from bender_watch.follow.rows import Rows
from bender_watch.follow.sources import Source
from bender_watch.session import Session
from bender_watch.settings import Settings
from bender_watch.watcher import Watcher


def written_run(folder: Path, record: Any) -> None:
    """Write a record as the journals of a run that is over."""
    folder.mkdir()
    run: list[dict[str, Any]] = [{"kind": "start", "delay_s": 0.0}]
    guard = []
    for k, (time_s, volts, read) in enumerate(
        zip(record.time_s, record.voltage_V, record.displacement_um, strict=True)
    ):
        at = {"grabbed_s": 50.0 + time_s, "sent_s": 50.0 + time_s, "measured_um": read}
        run.append({"kind": "tick", "sequence": k, "setpoint_um": None, "command_V": volts} | at)
        guard.append({"kind": "applied", "sequence": k, "voltage_V": volts, "command_time_s": 50.0 + time_s})
    for name, entries in ((RUN, [*run, {"kind": "stop"}]), (GUARD, guard)):
        (folder / name).write_text("".join(json.dumps({"n": 0, "t": 0.0, **x}) + "\n" for x in entries))


def test_the_page_of_a_run_shows_residual_statistic_and_alarm(device: Any, tmp_path: Path) -> None:

    written_run(tmp_path / "run", device.recorded(4, 1.05))
    how = Settings(rows_between_false_alarms=1e5, diagnose=False, explain_rows=200)
    source = Source([tmp_path / "run"], Naming(), follow=False)
    watcher = Session(load_model("beam"), source, how, tmp_path / "out", read_record(device.training)).run()
    shown = Shown(tmp_path / "run", None, "")
    shown.look(0.0)
    lanes = charts(shown)
    statistic = [y for _, y in lanes["statistic"][0] if y is not None]
    assert watcher.alarms >= 1
    assert max(statistic) >= 1.0
    assert len(statistic) > 100
    assert "alarm 1, since" in dict(facts(shown))["watch"]


def test_rows_become_extremes_of_tenths_of_a_second(tmp_path: Path) -> None:
    beside = BesideRun(tmp_path)
    time_s = np.arange(10) / 50.0
    beside.see(time_s, np.array([0.0, 3.0, -2.0, 0.0, 0.0, np.nan, 1.0, 0.0, 0.0, 0.0]), 0.1 * np.arange(10.0))
    beside.see(time_s[:1], np.array([np.nan]), np.zeros(1))
    (line,) = (tmp_path / "watch.jsonl").read_text().splitlines()
    assert json.loads(line)["rows"] == [[0.0, -2.0, 3.0, 0.4], [0.12, 0.0, 1.0, 0.9]]


def test_a_folder_that_cannot_be_written_is_said_once(tmp_path: Path) -> None:
    told: list[str] = []
    beside = BesideRun(tmp_path / "gone", told.append)
    beside.begin()
    for _ in range(3):
        beside.see(np.zeros(1), np.zeros(1), np.zeros(1))
    assert len(told) == 1
    assert "the live page shows no watch" in told[0]


def test_a_watch_that_is_refused_leaves_nothing_in_the_run_and_one_that_judges_begins_anew(
    device: Any, tmp_path: Path
) -> None:
    written_run(tmp_path / "run", device.recorded(4, 1.05))
    words = ["watch", "beam", str(tmp_path / "run"), "--replay", "--no-diagnosis", "--out", str(tmp_path / "out")]
    before = {path: path.read_bytes() for path in (tmp_path / "run").iterdir()}
    assert main([*words, "--learn", "1000000"]) == 2
    assert {path: path.read_bytes() for path in (tmp_path / "run").iterdir()} == before
    beside = BesideRun(tmp_path)
    beside.begin()
    assert not (tmp_path / "watch.jsonl").exists()
    for _ in range(2):
        beside.see(np.zeros(1), np.zeros(1), np.zeros(1))
    kinds = [json.loads(x)["kind"] for x in (tmp_path / "watch.jsonl").read_text().splitlines()]
    assert kinds == ["begin", "lane", "lane"]


def test_a_run_is_known_to_begin_at_rest_by_its_first_reading(device: Any, tmp_path: Path) -> None:
    """Its first command is not 0 V, and acts behind the first reading."""
    known = read_record(device.training)
    record = replace(known, voltage_V=known.voltage_V + 12.0, command_time_s=known.time_s + 0.01)
    creeping = load_model("paper")
    plain = OfModel(creeping)
    plain.begin(0.0, 0.0, rest=True)
    clean, _ = plain.advance(record.time_s, record.voltage_V, record.command_time_s)
    rng = np.random.default_rng(3)
    training, fresh = (
        replace(record, displacement_um=clean + 0.05 * rng.standard_normal(clean.size)) for _ in range(2)
    )
    baseline = learn(creeping, training, 1e5)
    assert baseline.rest
    assert baseline.range.low_V == 0.0
    watcher = Watcher(creeping, training, baseline, Settings(rows_between_false_alarms=1e5, diagnose=False))
    rows = Rows.of(fresh)
    events = [*watcher.begin_record("fresh", rows.part(slice(0, 1))), *watcher.take(rows)]
    assert [x["event"] for x in events] == ["record"]
    assert events[0]["rest"]
    assert watcher.judged == len(rows)
    moving = Rows.of(fresh).part(slice(400, None))
    assert not next(watcher.begin_record("in motion", moving))["rest"]
    assert not next(watcher.begin_record("of no run", replace(rows, command_time_s=None)))["rest"]
