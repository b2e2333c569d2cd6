"""Bench files, calibrations, gains, profiles and logs that mean harm are refused soon and in one line."""

import contextlib
import json
import math
import os
import time
from argparse import Namespace
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from few import few

from bender_cli.main import main
from bender_emulator.microscope.settings import SceneSettings
from bender_emulator.terminals import TerminalSettings
from bender_hil.bench_file import BenchFile, CameraTable, ControllerTable, emulated_bench, read_bench
from bender_hil.camera.settings import CameraSettings
from bender_hil.command import OWN_GAINS, make_program
from bender_hil.emulated import EmulationSettings
from bender_hil.guard.settings import GuardSettings
from bender_hil.log.replay import replay_run
from bender_hil.log.results import recover
from bender_hil.supply.select import SupplySettings
from bender_loop.errors import InputError
from bender_tuner.results.gains_file import read_gains
from bender_vision.scale import Calibration
from bender_vision.settings import TrackerSettings

LONGEST_S = 2.0
VALUES = [
    "0", "-1", "1", "0.5", "nan", "inf", "-inf", "1e308", "-1e308", "1e-308", "5e-324", "1e9", "1000000000", "true",
    "9" * 30, "9" * 400, "9" * 5000, '""', '"a\\u0000b"', '"a\\nb"', '"' + "x" * 5000 + '"', '"/dev/zero"', '"."',
    '"missing"', '"pipe"', "[]", "[1]", "[1, 2]", "[nan, inf]", "[2, 1]", "[" * 5000 + "]" * 5000, "[[1, 2], [3]]",
    "{}", "{a = 1}", "1979-05-27", "07:32:00", "'auto'", "'9115'", "'tcp'", "0x10", "1_0", "'\\udcff'", "+1", "-0.0",
]  # fmt: skip
TABLES = {
    "supply": SupplySettings, "camera": CameraTable, "camera.settings": CameraSettings, "vision": TrackerSettings,
    "guard": GuardSettings, "controller": ControllerTable, "emulator": EmulationSettings,
    "emulator.scene": SceneSettings, "emulator.terminals": TerminalSettings, "emulator.parameters": None,
}  # fmt: skip
REAL = '[supply]\nresource = "ASRL1::INSTR"\n[camera]\nsource = 0\ncalibration = "calibration.toml"\n'


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Calibration.of_scale(1.5).save(tmp_path / "calibration.toml")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
    return tmp_path


def _refused(work: Callable[[], object], what: str) -> bool:
    """Whether bad input was refused, as it must be; anything else that is raised, or takes long, fails."""
    start_s = time.perf_counter()
    with contextlib.suppress(InputError):
        work()
        return False
    assert time.perf_counter() - start_s < LONGEST_S, what
    return True


def _read_all(path: Path, **words: object) -> BenchFile:
    """Everything that is read before anything is switched on."""
    bench = read_bench(path)
    bench.load_calibration()
    usual = {"duration": None, "profile": None, "setpoint": None, "gains": None}
    make_program(Namespace(**{**usual, **words}), bench, read_gains)
    return bench


def _bounded(value: object) -> bool:
    """Whether all numbers in settings are finite and of a size that something can be."""
    if isinstance(value, float | int):
        return math.isfinite(value) and abs(value) <= 2**63
    if isinstance(value, dict):
        return all(map(_bounded, value.values()))
    if isinstance(value, tuple | list):
        return all(map(_bounded, value))
    return True


def _key(rng: np.random.Generator, table: str) -> str:
    kind = TABLES[table]
    names = ["x"] if kind is None else [entry.name for entry in fields(kind)]
    return str(rng.choice([*names, "bogus"] if rng.random() < 0.1 else names))


@pytest.mark.parametrize("seed", few(range(12), 0))
def test_bench_files_with_hostile_values(folder: Path, seed: int):
    rng = np.random.default_rng(seed)
    path, refused = folder / "bench.toml", 0
    for _ in range(60):
        table = str(rng.choice(list(TABLES)))
        is_emulated = table.startswith("emulator") or (table != "supply" and rng.random() < 0.5)
        key, value = _key(rng, table), str(rng.choice(VALUES))
        lines = "[emulator]\n" if is_emulated else REAL
        if f"[{table}]\n" in lines:
            names = [line for line in lines.splitlines() if not line.startswith(f"{key} =")]
            lines = "\n".join(names).replace(f"[{table}]", f"[{table}]\n{key} = {value}")
        else:
            lines += f"[{table}]\n{key} = {value}\n"
        path.write_bytes(lines.encode("utf-8", "surrogatepass"))
        found: list[BenchFile] = []
        refused += _refused(lambda found=found: found.append(_read_all(path)), f"{table}.{key} = {value[:60]}")
        for bench in found:
            assert _bounded(bench.facts()), f"{table}.{key} = {value[:60]}"
    assert 20 <= refused <= 60


@pytest.mark.parametrize(
    "text",
    [
        "[emulator]\nstep_s = 0\n",
        "[emulator]\nstep_s = nan\n",
        "[emulator]\nstep_s = -1\n",
        "[emulator]\nseed = -1\n",
        '[emulator]\nmodel = "a\\u0000b.toml"\n',
        '[emulator]\nmodel = ""\n',
        f"[emulator]\nseed = {'9' * 5000}\n",
        f"a = {'[' * 5000}{']' * 5000}\n",
        f"{'a.' * 5000}a = 1\n",
        "[guard]\nprotection_V = inf\n",
        "[emulator]\n[camera]\nzero_frames = 1000000000\n",
        "[emulator]\n[emulator.scene]\nwidth_px = 8192\nheight_px = 8192\n",
        "[emulator]\nexposure_s = 0.5\n",
        "[emulator]\n[vision]\nwire_um = 1e4\n",
        "[emulator]\n[vision]\nwire_um = 0.1\n",
        "[emulator]\n[controller]\nresponse_um_per_V = -1\n",
        "[emulator]\n[emulator.parameters]\nx = nan\n",
        f"{REAL}[camera.settings]\nexposure = inf\n",
        REAL.replace("source = 0", "source = -1"),
        REAL.replace("[camera]", "timeout_s = inf\n[camera]"),
        REAL.replace("[camera]", "baud = -5\n[camera]"),
        REAL.replace("[camera]", 'model = "33xxx"\ngain = 0.0\n[camera]'),
    ],
)
def test_what_was_found_before_stays_refused(folder: Path, text: str):
    (folder / "bench.toml").write_text(text)
    assert _refused(lambda: _read_all(folder / "bench.toml"), text[:80])


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes and devices of Unix")
@pytest.mark.parametrize("name", ["pipe", "/dev/zero", ".", "a\nb", "x" * 5000])
def test_files_that_are_none_are_refused_wherever_they_are_named(folder: Path, capfd, name: str):
    (folder / "run").mkdir()
    (folder / "run" / "run.jsonl").symlink_to(folder / "pipe")
    (folder / "named.toml").write_text(f"[emulator]\nfmu = {json.dumps(name)}\n")
    (folder / "model.toml").write_text(f"[emulator]\nmodel = {json.dumps(name)}\n")
    for words in (
        ["--bench", name],
        ["--bench", "named.toml"],
        ["--bench", "model.toml"],
        ["--gains", name],
        ["--profile", name],
        ["replay", name],
        ["replay", "run"],
        ["recover", "run"],
    ):
        before = sorted(folder.rglob("*"))
        start_s = time.perf_counter()
        assert main(["hil", *words, "--out", "out"]) == 2, words
        assert time.perf_counter() - start_s < LONGEST_S, words
        err = capfd.readouterr().err
        assert len(err.splitlines()) == 1, err
        assert err.strip().isprintable()
        assert len(err) < 1000
        assert "a fault in bender" not in err
        assert sorted(folder.rglob("*")) == before


def _mutated(rng: np.random.Generator, data: bytes) -> bytes:
    """Bytes with a few of them replaced, removed, doubled, or with something nasty put in."""
    nasty = [
        b"\x00", b"\xff\xfe", b"nan", b"inf", b"1e999", b"-1e308", b"9" * 400, b"[" * 3000, b'"', b"\n", b",", b"=",
        b"null", b"{}", b"\xef\xbb\xbf", b"\r", b"1e308", b"0", b"true", b"[]", b'"x"', b"-1",
    ]  # fmt: skip
    for _ in range(int(rng.integers(1, 4))):
        place, length = int(rng.integers(0, len(data) + 1)), int(rng.integers(0, 12))
        part = nasty[int(rng.integers(len(nasty)))] if rng.random() < 0.7 else data[place : place + 40]
        data = data[:place] + part + data[place + length :]
    return data[: int(rng.integers(0, len(data) + 1))] if rng.random() < 0.1 else data


@pytest.mark.parametrize("seed", few(range(4), 0))
def test_mutated_files(folder: Path, seed: int):
    rng = np.random.default_rng(100 + seed)
    bench, path = emulated_bench(), folder / "file"
    usual = {"duration": None, "profile": None, "setpoint": None, "gains": None}

    def program(**words: object) -> object:
        return make_program(Namespace(**{**usual, **words}), bench, read_gains)

    def load_bench() -> None:
        assert _bounded(_read_all(path).facts())

    setpoints = b"time_s,setpoint_um\n0,0\n1,5\n2,10\n3,0\n"
    volts = b"time_s,voltage_V\n0,0\n0.5,5\n1,10\n2,0\n"
    calibration = (folder / "calibration.toml").read_bytes()
    whole = f"{REAL}frames_per_s = 30\n[vision]\nwire_um = 15.0\n[guard]\nmaximum_V = 40.0\nlost_frames = 2\n".encode()
    refused = 0
    for _ in range(60):
        for data, work in (
            (whole, load_bench),
            (calibration, lambda: Calibration.load(path)),
            (OWN_GAINS.read_bytes(), lambda: program(gains=path)),
            (setpoints, lambda: program(profile=str(path))),
            (volts, lambda: program(profile=str(path))),
        ):
            text = _mutated(rng, data)
            path.write_bytes(text)
            refused += _refused(work, repr(text[:400]))
    assert refused > 100


def _log(folder: Path) -> bytes:
    """The journal of a small run, closed loop."""
    gains = {"proportional_V_per_um": 0.3, "integral_V_per_um_s": 4.0}
    program = {
        "mode": "closed_loop", "gains": gains, "limits": {"lower_V": 0.0, "upper_V": 50.0}, "slew_V_per_s": 225.0,
        "duration_s": 1.0,
    }  # fmt: skip
    guard = {"travel_um": [-10.0, 45.0], "maximum_V": 50.0, "minimum_V": 0.0}
    entries = [{"kind": "start", "program": program, "emulated": True, "delay_s": 0.002, "bench": {"guard": guard}}]
    for k in range(4):
        entries.append(
            {
                "kind": "tick", "sequence": k, "grabbed_s": 5.0 + k / 30, "time_s": k / 30, "dt_s": 0.033, "lost": None,
                "measured_um": 0.1 * k, "setpoint_um": 5.0, "command_V": 1.0, "sent_s": 5.003 + k / 30, "skipped": 0,
                "late": False,
            }
        )  # fmt: skip
    applied = [
        {"n": k, "kind": "applied", "sequence": k, "voltage_V": 1.0, "command_time_s": 5.005 + k / 30, "whole": True}
        for k in range(4)
    ]
    (folder / "guard.jsonl").write_text("".join(json.dumps(entry) + "\n" for entry in applied))
    return "".join(json.dumps({"n": n, **entry}) + "\n" for n, entry in enumerate(entries)).encode()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_mutated_logs(folder: Path, seed: int):
    rng = np.random.default_rng(200 + seed)
    data = _log(folder)
    (folder / "run.jsonl").write_bytes(data)
    assert replay_run(folder).ticks == 4
    guard = (folder / "guard.jsonl").read_bytes()
    refused = 0
    for k in range(150):
        texts = (_mutated(rng, data), guard) if k % 3 else (data, _mutated(rng, guard))
        for name, text in zip(("run.jsonl", "guard.jsonl"), texts, strict=True):
            (folder / name).write_bytes(text)
        refused += _refused(lambda: replay_run(folder), repr(texts))
        before = (folder / "record.csv").exists()
        if _refused(lambda: recover(folder), repr(texts)):
            assert not before
            assert not (folder / "record.csv").exists(), repr(texts)
        for name in ("record.csv", "summary.json", "summary.html"):
            (folder / name).unlink(missing_ok=True)
    assert refused > 50


def test_the_gains_of_another_actuator_are_said_on_a_bench_that_is_not_emulated(capsys: pytest.CaptureFixture[str]):
    words = {"duration": None, "profile": None, "setpoint": None, "gains": None}
    real = replace(emulated_bench(), emulator=None)
    make_program(Namespace(**words), real, read_gains)
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert "those of the paper's actuator" in said
    assert "bender tune --model" in said
    make_program(Namespace(**words), emulated_bench(), read_gains)
    make_program(Namespace(**words | {"gains": OWN_GAINS}), real, read_gains)
    make_program(Namespace(**words, controller=Path("mine.fmu")), real, read_gains)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("proportional_V_per_um = ", "proportional_V_per_um = 1e308 #", "at most 1e"),
        ("upper_V = ", "upper_V = 300.0 #", None),
        ("lower_V = ", "lower_V = 100.0\nupper_V = 200.0 #", "nothing in common"),
    ],
)
def test_gains_that_fit_no_guard(folder: Path, old: str, new: str, complaint: str | None):
    lines = [line for line in OWN_GAINS.read_text().splitlines() if not (old[:5] == "lower" and "upper_V" in line)]
    text = "\n".join(lines).partition("[isa]")[0].partition("[discrete]")[0].replace(old, new, 1)
    (folder / "gains.toml").write_text(text)
    words = Namespace(duration=None, profile=None, setpoint=None, gains=folder / "gains.toml")
    if complaint is None:
        make_program(words, emulated_bench(), read_gains)
        return
    with pytest.raises(InputError, match=complaint):
        make_program(words, emulated_bench(), read_gains)
