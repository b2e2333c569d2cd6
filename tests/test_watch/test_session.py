"""Whole watches over files: what is said, what is kept, and how one goes on that was killed."""

import contextlib
import itertools
import json
import os
import tempfile
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bender_cli.main import main
from bender_export.build import ensure_plant_fmu
from bender_loop.errors import InputError, RunError
from bender_loop.records.record import read_record
from bender_plant.model import load_model
from bender_watch.baseline.expectation import OfFmu
from bender_watch.baseline.learn import learn
from bender_watch.follow.heading import Naming
from bender_watch.follow.rows import Rows
from bender_watch.follow.sources import Arrival, Source
from bender_watch.session import EVENTS, STATE, Session
from bender_watch.settings import Settings
from bender_watch.watcher import Watcher

HOW = Settings(rows_between_false_alarms=1e5, diagnose=False, explain_rows=200)


@pytest.fixture(scope="module", autouse=True)
def learned_once(device: Any) -> Any:
    """What is learned of one training record is the same every time."""
    training = read_record(device.training)
    known = learn(load_model("beam"), training, HOW.rows_between_false_alarms)

    def learned(model: Any, record: Any, *words: Any, **named: Any) -> Any:
        is_known = np.array_equal(record.displacement_um, training.displacement_um)
        return known if is_known else learn(model, record, *words, **named)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("bender_watch.session.learn", learned)
        yield


class Killed(Source):
    """A source under which the process dies after so many parts; 0 for never."""

    after = 0

    def arrivals(self) -> Iterator[Arrival]:
        for k, arrival in enumerate(super().arrivals(), 1):
            if self.after and k > self.after:
                raise RuntimeError("killed")
            yield arrival


def watched(device: Any, out: Path, *paths: Path, stop_after: int = 0) -> list[dict[str, Any]]:
    """Watch files; stop without a word, as a kill does, after so many parts."""
    source = Killed(paths, Naming(), follow=False)
    source.after = stop_after
    clock = iter(range(10**6)).__next__
    session = Session(load_model("beam"), source, HOW, out, read_record(device.training), clock=clock)
    session.run()
    return [json.loads(x) for x in (out / EVENTS).read_text(encoding="utf-8").splitlines()]


def kinds(events: list[dict[str, Any]]) -> list[str]:
    return [x["event"] for x in events if x["event"] not in ("baseline", "record", "trend")]


@pytest.mark.parametrize("is_trained", [False, True])
@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("bad.csv", ""),
        ("bad.csv", "a,b,c\n1,2,3\n"),
        ("bad.csv", "time_s,voltage_V,displacement_um\n0.0,x,1.0\n"),
        ("", "look at the clamp\n" * 500),
    ],
    ids=["empty", "no columns", "no number", "a folder with a note"],
)
def test_what_is_no_record_leaves_nothing_behind(
    name: str, content: str, is_trained: bool, device: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "records").mkdir()
    (tmp_path / "records" / (name or "a_note.txt")).write_text(content, encoding="utf-8")
    words = ["--replay", "--no-diagnosis", "--out", str(tmp_path / "out")]
    training = ["--training", str(device.training)] if is_trained else []
    assert main(["watch", "beam", str(tmp_path / "records" / name), *words, *training]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("rows", [40, 400])
def test_an_fmu_leaves_no_files_whether_it_was_driven_or_not(
    rows: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An alarm ends the process at once, with no end of the interpreter that would remove them."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    path = tmp_path / "record.csv"
    lines = "".join(f"{0.02 * k:.2f},{10.0 * (k // 25 % 2):g},{k % 7 * 0.01:g}\n" for k in range(rows))
    path.write_text(f"time_s,voltage_V,displacement_um\n{lines}", encoding="utf-8")
    settings = replace(HOW, learn_rows=200)
    session = Session(
        OfFmu(ensure_plant_fmu("paper")), Source((path,), Naming(), follow=False), settings, tmp_path / "out"
    )
    with contextlib.nullcontext() if rows > 200 else pytest.raises(InputError, match="found 40 rows"):
        session.run()
    assert list(temporary.iterdir()) == []


def test_an_fmu_that_breaks_down_does_not_take_the_watch_along(tmp_path: Path) -> None:
    """Without the entry that names its module, the native part of a PythonFMU is a null pointer."""
    broken = tmp_path / "broken.fmu"
    with zipfile.ZipFile(ensure_plant_fmu("paper")) as whole, zipfile.ZipFile(broken, "w") as archive:
        for name in whole.namelist():
            if name != "resources/slavemodule.txt":
                archive.writestr(name, whole.read(name))
    with pytest.raises(RunError, match="the process that ran the FMU broke off"):
        OfFmu(broken)


@pytest.mark.skipif(os.name == "nt", reason="pipes and devices of POSIX")
def test_what_never_ends_is_refused_and_passed_over_in_a_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    for path, found in ((tmp_path / "pipe.csv", "a pipe"), (Path("/dev/zero"), "a device")):
        assert main(["watch", "beam", str(path), "--replay", "--out", str(tmp_path / "out")]) == 2
        assert f"found {found}" in capsys.readouterr().err
    assert main(["watch", "beam", str(tmp_path), "--replay", "--out", str(tmp_path / "out")]) == 2
    assert "found no file, expected records" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_its_own_repeat_is_no_alarm(device: Any, tmp_path: Path) -> None:
    assert kinds(watched(device, tmp_path, device.write("repeat.csv", 2), device.write("third.csv", 3))) == []


def test_a_gain_that_changes_is_an_alarm_that_says_since_when(device: Any, tmp_path: Path) -> None:
    events = watched(device, tmp_path, device.write("changed.csv", 4, 1.05))
    alarm = next(x for x in events if x["event"] == "alarm")
    assert 600 < alarm["row"] <= 640
    assert alarm["since"]["row_low"] <= 632
    assert kinds(events)[1] == "explained"


def test_amplitudes_outside_the_training_range_are_said_once_and_not_judged(device: Any, tmp_path: Path) -> None:
    events = watched(device, tmp_path, device.write("wide.csv", 5, volts=1.6))
    assert set(kinds(events)) == {"outside_training_range", "inside_again"}
    rows = [x["row"] for x in events if x["event"] in ("outside_training_range", "inside_again")]
    assert all(back - gone > 64 for gone, back in zip(rows[::2], rows[1::2], strict=False))


def test_every_crest_of_a_slow_sine_is_no_news(device: Any) -> None:
    """Each excursion that is said asks for twice as many rows inside before the next one is."""
    training = read_record(device.training)
    baseline = learn(load_model("beam"), training, HOW.rows_between_false_alarms)
    watcher, time = Watcher(load_model("beam"), training, baseline, HOW), baseline.interval_s * np.arange(8_000.0)
    known = baseline.range
    volts = 0.5 * (known.low_V + known.high_V) + 0.6 * (known.high_V - known.low_V) * np.sin(np.arange(8_000) / 100.0)
    rows = Rows(time, volts, np.full(8_000, np.nan), None)
    said = [x["event"] for x in [*watcher.begin_record("own", rows), *watcher.take(rows)]]
    assert 1 <= said.count("outside_training_range") <= 4
    assert watcher.excursions.rows > 2000


def test_one_that_was_killed_goes_on_and_says_nothing_twice(
    device: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bender_watch.follow.growing.BYTES_AT_ONCE", 4096)
    monkeypatch.setattr("bender_watch.session.SAVED_EVERY_S", 3)
    path = device.write("long.csv", 6, 1.05)
    whole = watched(device, tmp_path / "whole", path)
    for stop in (5, 8):
        with pytest.raises(RuntimeError, match="killed"):
            watched(device, tmp_path / "killed", path, stop_after=stop)
    assert (tmp_path / "killed" / STATE).exists()
    assert watched(device, tmp_path / "killed", path) == whole
    assert "alarm" in kinds(whole)


def test_one_that_is_run_again_says_nothing_twice(device: Any, tmp_path: Path) -> None:
    paths = [device.write("again.csv", 7), device.write("more.csv", 8)]
    once = watched(device, tmp_path, *paths)
    assert once[-1]["event"] == "trend"
    assert watched(device, tmp_path, *paths) == once


def test_the_command_says_it_by_its_exit_status(
    device: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changed = device.write("changed.csv", 4, 1.05)
    words = ["watch", "beam", str(changed), "--training", str(device.training), "--replay", "--no-diagnosis"]
    status = main([*words, "--between-false-alarms", "1e5", "--out", str(tmp_path / "out"), "--jsonl"])
    events = [json.loads(x) for x in capsys.readouterr().out.splitlines()]
    assert status == 3
    assert any(x["event"] == "alarm" for x in events)
    assert json.loads((tmp_path / "out" / "watch.json").read_text(encoding="utf-8"))["alarms"] >= 1
    assert "<html" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nothing.csv"], "nothing.csv: no such file"),
        (["--between-false-alarms", "soon"], "expected rows as 1e6"),
        (["--explain-after", "3"], "found 3 rows, expected 64"),
        (["--units", "furlong"], "--units"),
    ],
)
def test_bad_input_is_one_line(
    words: list[str], said: str, device: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = words if words[0].endswith(".csv") else [str(device.training), *words]
    status = main(["watch", "beam", *record, "--replay", "--out", str(tmp_path / "out")])
    told = capsys.readouterr().err.strip().splitlines()
    assert status == 2
    assert said in told[-1]
    assert not (tmp_path / "out").exists()


def test_two_watches_do_not_write_into_one_directory(device: Any, tmp_path: Path) -> None:
    path = device.write("long.csv", 6)

    class Second(Source):
        def arrivals(self) -> Iterator[Arrival]:
            yield from super().arrivals()
            with pytest.raises(InputError, match="another watch writes there"):
                watched(device, tmp_path / "out", path)

    source = Second([path], Naming(), follow=False)
    Session(load_model("beam"), source, HOW, tmp_path / "out", read_record(device.training)).run()
    assert watched(device, tmp_path / "out", path)


def test_an_interrupt_while_rows_are_judged_loses_none(
    device: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = device.write("long.csv", 6, 1.05)
    whole = watched(device, tmp_path / "whole", path)
    monkeypatch.setattr("bender_watch.follow.growing.BYTES_AT_ONCE", 8192)
    taken = Watcher._remember
    count = itertools.count()

    def interrupted(*words: Any) -> None:
        taken(*words)
        if next(count) == 3:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Watcher, "_remember", interrupted)
        with pytest.raises(KeyboardInterrupt):
            watched(device, tmp_path / "out", path)
    assert watched(device, tmp_path / "out", path) == whole


@pytest.mark.skipif(os.name == "nt", reason="limits of POSIX")
def test_a_full_disk_is_one_line(device: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import resource

    words = ["watch", "beam", str(device.training), "--training", str(device.training), "--replay", "--no-diagnosis"]
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))
    try:
        assert main([*words, "--out", str(tmp_path / "out")]) == 2
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "events.jsonl: cannot be written" in capsys.readouterr().err


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"none"])
def test_a_damaged_state_is_one_line(
    content: bytes, device: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / STATE).write_bytes(content)
    words = ["watch", "beam", str(device.training), "--training", str(device.training), "--replay", "--no-diagnosis"]
    assert main([*words, "--out", str(tmp_path)]) == 2
    assert "remove it to begin anew" in capsys.readouterr().err
