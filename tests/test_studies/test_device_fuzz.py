"""The campaign of devices drawn at random: a slice of it, and that it would notice."""

import json
import re
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from few import few_rows

from bender_cli.main import main
from bender_identify.first_model.structures import Structure
from bender_loop.records.record import Record
from bender_loop.records.zero_move import zero_move
from bender_proving.devices.device import Device
from bender_proving.devices.record import draw
from bender_studies.device_fuzz import campaign
from bender_studies.device_fuzz.campaign import Tried, try_device

DEVICES = (502, 504)


def stand_in(folder: Path, monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    """Let a script stand in for `bender` in processes of their own."""
    (folder / "bender_cli").mkdir()
    (folder / "bender_cli" / "__init__.py").touch()
    (folder / "bender_cli" / "__main__.py").write_text(script)
    monkeypatch.setenv("PYTHONPATH", str(folder))


@pytest.mark.slow
def test_devices_that_are_drawn_come_to_an_end_without_noise_or_a_false_name():
    """`bender benchmark fuzz --devices N` tries as many as one likes."""
    tried = [try_device(draw(seed), 300.0) for seed in DEVICES]
    assert [x.faults + x.hangs + x.noise + x.false for x in tried] == [[]] * len(tried)
    assert all(x.outcome for x in tried)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "what"),
    few_rows(
        [
            ("raise SystemExit(1)", "faults"),
            ("import time; time.sleep(9)", "hangs"),
            ("import sys; print('{}'); print('library', file=sys.stderr)", "noise"),
            ("print('On entry to DLASCL'); print('{}')", "noise"),
        ],
        0,
        1,
    ),
)
def test_what_a_device_brings_to_light_is_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str, what: str
):
    stand_in(tmp_path, monkeypatch, script)
    tried = try_device(draw(504), 2.0)
    assert getattr(tried, what)
    assert tried.complaints


GRADES = {"creep": "certain", "sensor_lag": "certain", "fold": "likely"}


@pytest.mark.parametrize(("factor", "is_worse"), [(1.0, False), (20.0, True)])
def test_a_certain_name_that_is_not_in_the_device_and_a_model_that_is_worse_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, factor: float, is_worse: bool
):
    drawn = draw(504)
    calm = replace(drawn.habits, jump=0.0)
    lag = replace(drawn, device=Device(("lag",), 2.0, ((0.1,) * 6,), 0.05), habits=calm)
    gain = lag.device.gain * lag.habits.scale
    first, corrected = (tomli_w.dumps(Structure().model([], gain * x).to_table()) for x in (1.0, factor))
    told = {"verdict": "named", "effects": [{"id": x, "grade": y} for x, y in GRADES.items()]}
    script = (
        "import pathlib, sys\n"
        f"pathlib.Path('first.toml').write_text({first!r})\n"
        "pathlib.Path('out').mkdir(exist_ok=True)\n"
        f"pathlib.Path('out/model.toml').write_text({corrected!r})\n"
        f"print({json.dumps(told)!r} if 'diagnose' in sys.argv else '{{}}')\n"
    )
    stand_in(tmp_path, monkeypatch, script)
    tried = try_device(lag, 60.0)
    assert tried.outcome == "named"
    assert tried.certain == ["creep", "sensor_lag"]
    assert tried.false == ["creep"]
    assert [(x["id"], x["is_there"]) for x in tried.told] == [("creep", False), ("sensor_lag", True), ("fold", False)]
    assert (tried.worse is not None) is is_worse
    assert len(tried.complaints) == 1 + is_worse


def test_a_false_name_and_a_worse_model_are_told():
    tried = Tried(7, ("lag",), "named", ["creep"], ["creep"], worse=3.0)
    assert tried.complaints == [
        "device 7 (lag): creep is called certain", "device 7 (lag): the corrected model is 3 times worse",
    ]  # fmt: skip


def test_an_interrupt_keeps_the_devices_that_are_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def tried(count: int, seed: int, processes: int) -> Generator[Tried, None, None]:
        del count, processes
        yield Tried(seed, ("lag",), "named", certain=["sensor_lag"])
        raise KeyboardInterrupt

    monkeypatch.setattr(campaign, "try_devices", tried)
    assert main(["benchmark", "fuzz", "--devices", "5", "--seed", "7", "--out", str(tmp_path / "out")]) == 130
    written = json.loads((tmp_path / "out" / "devices.json").read_text(encoding="utf-8"))
    assert written["devices"] == 1
    assert written["tried"][0]["seed"] == 7
    printed = capsys.readouterr().out
    assert "Devices drawn at random" in printed
    assert re.search(r"devices +1\b", printed)


@pytest.mark.slow
def test_jumps_of_the_reading_are_told_and_nothing_that_a_device_does(tmp_path: Path) -> None:
    told: dict[bool, list[bool]] = {True: [], False: []}
    for seed in range(1000, 1600):
        strange = draw(seed)
        strange.write(tmp_path / "record.csv", 0)
        time_s, command, reading = np.genfromtxt(tmp_path / "record.csv", delimiter=",", skip_header=1, unpack=True)
        found = zero_move(Record(time_s, command, reading))
        told[strange.habits.jump > 0.0].append(found is not None)
    print(f"{sum(told[True])} of {len(told[True])} jumps told, {sum(told[False])} of {len(told[False])} other records")
    assert sum(told[True]) >= 0.7 * len(told[True])
    assert not any(told[False])
