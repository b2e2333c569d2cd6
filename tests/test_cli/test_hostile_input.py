"""Files and options that nobody would give on purpose: refused at once, in one line, with nothing written."""

import math
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from bender_cli.main import main
from bender_loop.errors import InputError
from bender_loop.shell.bounded import read_bounded

ROWS = [(k / 30, 25.0 - 25.0 * math.cos(0.2 * k), 12.0 - 12.0 * math.cos(0.2 * k - 0.2)) for k in range(200)]
Row = tuple[float, float, float]


def record(path: Path, change: Callable[[int, Row], Row] = lambda _, row: row) -> Path:
    rows = (",".join(map(repr, change(k, row))) for k, row in enumerate(ROWS))
    path.write_text("\n".join(["time_s,voltage_V,displacement_um", *rows]) + "\n", encoding="utf-8")
    return path


def refused(capsys: pytest.CaptureFixture[str], words: Sequence[object], said: str, folder: Path) -> None:
    before, began = sorted(folder.rglob("*")), time.monotonic()
    assert main([str(word) for word in words]) == 2
    assert time.monotonic() - began < 30.0
    found = capsys.readouterr()
    assert len(found.err.splitlines()) == 1, found.err
    assert said in found.err
    assert sorted(folder.rglob("*")) == before


STRANGE: dict[str, tuple[Callable[[int, Row], Row], str]] = {
    "a gap of 1e12 s": (lambda k, r: (r[0] + 1e12 * (k > 99), r[1], r[2]), "time_s spans 1e+12 s"),
    "a gap of three years": (lambda k, r: (r[0] + 9e7 * (k > 99), r[1], r[2]), "sub-steps, expected at most"),
    "one reading without bounds": (lambda k, r: (r[0], r[1], 1.7e308 if k == 50 else r[2]), "reaches 1.7e+308 µm"),
    "one voltage without bounds": (lambda k, r: (r[0], 1e308 if k == 50 else r[1], r[2]), "reaches 1e+308 V"),
    "times of no length": (lambda k, r: (k * 5e-324, r[1], r[2]), "time_s"),
    "readings whose squares vanish": (lambda k, r: (r[0], r[1], 5e-324 * (k % 2)), "name the unit of the column"),
}


@pytest.mark.parametrize("command", ["compare", "identify", "diagnose"])
@pytest.mark.parametrize("name", STRANGE)
def test_numbers_that_no_bench_gives(
    command: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, said = STRANGE[name]
    path = record(tmp_path / "strange.csv", change)
    refused(capsys, [command, path, "--out", tmp_path / "out.toml"], said, tmp_path)


def test_metres_taken_for_micrometres(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = record(tmp_path / "metres.csv", lambda _, r: (r[0], r[1], 1e-6 * r[2]))
    refused(
        capsys, ["identify", path, "--out", tmp_path / "m.toml"], "expected at least 0.001; say what units", tmp_path
    )


@pytest.mark.skipif(os.name == "nt", reason="pipes with a name are of POSIX")
@pytest.mark.parametrize("command", ["compare", "identify", "diagnose"])
def test_a_pipe_that_nobody_writes_to(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    refused(capsys, [command, tmp_path / "pipe.csv", "--out", tmp_path / "out.toml"], "found a pipe", tmp_path)


def test_a_file_is_read_up_to_its_bound(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert read_bounded(path, 5, "five bytes") == b"12345"
    with pytest.raises(InputError, match="found more than 4 bytes, expected four bytes of at most that size"):
        read_bounded(path, 4, "four bytes")
    with pytest.raises(InputError, match="irectory"):
        read_bounded(tmp_path, 4, "a file")
    with pytest.raises(InputError, match="cannot be read"):
        read_bounded(Path("a\0b"), 4, "a file")


MODELS = {
    "deep.toml": "x = " + "[" * 5000 + "]" * 5000,
    "digits.toml": 'format = 1\nname = "x"\nblock = [{id = "paper_hysteresis", x = ' + "9" * 5000 + "}]",
    "huge.toml": 'format = 1\nname = "x"\n[beam]\nlength_m = 1' + "0" * 400,
    "list.toml": 'format = 1\nname = "x"\nblock = [{id = []}]',
    "date.toml": 'format = 1\nname = "x"\nblock = [{id = 1979-05-27}]',
}


@pytest.mark.parametrize("name", [*MODELS, "", "pipe.toml", "a\0b.toml", "/dev/zero"])
def test_models_that_cannot_be(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / name if name and "/" not in name else name
    if name in MODELS:
        (tmp_path / name).write_text(MODELS[name], encoding="utf-8")
    elif name == "pipe.toml":
        if os.name == "nt":
            pytest.skip("pipes with a name are of POSIX")
        os.mkfifo(tmp_path / name)
    rows = record(tmp_path / "sound.csv")
    for words in (["compare", rows], ["identify", rows], ["diagnose", rows], ["tune"], ["fmu", "build"]):
        refused(capsys, [*words, "--model", path, "--out", tmp_path / "out.toml"], "", tmp_path)


@pytest.mark.parametrize("key", ["lower", "upper", "beam"])
def test_numbers_of_a_model_that_overflow(key: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = Path(__file__).parents[2] / "plant_src" / "bender_plant" / "models" / "paper.toml"
    lines = source.read_text(encoding="utf-8").splitlines()
    value = {"lower": "-1.7e308", "upper": "1.7e308", "beam": "9" * 400}[key]
    for k, line in enumerate(lines):
        name, equals, number = line.partition(" = ")
        if not equals or not number[0].isdigit() or name == "format":
            continue
        path = tmp_path / "model.toml"
        path.write_text("\n".join([*lines[:k], f"{name} = {value}", *lines[k + 1 :]]), encoding="utf-8")
        status = main(["fmu", "build", "--model", str(path), "--out", str(tmp_path / "out.toml")])
        said = capsys.readouterr().err
        assert status in (0, 2), said
        assert "fault in bender" not in said
        shutil.rmtree(tmp_path / "out.toml", ignore_errors=True)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("proportional_V_per_um = 1e308", "parallel.proportional_V_per_um: found 1e+308"),
        ("integral_V_per_um_s = 1.7e308", "parallel.integral_V_per_um_s"),
        ("upper_V = 1e300", "limits.upper_V"),
        ("sampling_period_s = 1e-300", "sampling_period_s"),
        ("sampling_period_s = " + "9" * 5000, "not valid TOML"),
        ("sampling_period_s = " + "[" * 5000, "not valid TOML"),
    ],
)
def test_gains_that_no_controller_has(line: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (
        "sampling_period_s = 0.01\n[parallel]\nproportional_V_per_um = 1.0\nintegral_V_per_um_s = 2.0\n"
        "[limits]\nupper_V = 50.0\n"
    )
    key = line.partition(" ")[0]
    lines = [line if x.startswith(key) else x for x in text.splitlines()]
    (tmp_path / "gains.toml").write_text("\n".join(lines), encoding="utf-8")
    words = ["fmu", "build", "--gains", tmp_path / "gains.toml", "--out", tmp_path / "out.toml"]
    if "[[[" in line:
        said = ""
    refused(capsys, words, said, tmp_path)


@pytest.mark.parametrize(
    "words",
    [
        ["--duration", "1e308"], ["--latency", "1000000"], ["--setpoint", "1e308"], ["--setpoint", "-1e-300"],
        ["--rate", "1e308"], ["--rate", "1e-300"], ["--rate", "0"], ["--rate", "-5"], ["--noise", "1e308"],
        ["--exposure", "1e-300"], ["--exposure", "1e308"], ["--voltage-limits", "-1e308", "1e308"],
        ["--slew", "1e-300"], ["--slew", "1e308"], ["--evaluations", "9" * 30], ["--seed", "9" * 400],
        ["--monte-carlo", "9" * 30], ["--iterations", "9" * 5000],
    ],
)  # fmt: skip
def test_options_that_make_no_run(words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refused(capsys, ["tune", *words, "--out", tmp_path / "out.toml"], "", tmp_path)


@pytest.mark.parametrize(
    "words",
    [
        ["fmu", "build", "--out", "a\0b"],
        ["compare", "a\0b.csv"],
        ["diagnose", "sound.csv", "--highest-voltage=--"],
        ["tune", "--method=--"],
        ["compare", "sound.csv", "--fmu=--"],
    ],
)
def test_words_that_are_none(words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refused(capsys, words, "found ", tmp_path)


def _child(words: Sequence[str | bytes], folder: Path) -> "subprocess.CompletedProcess[bytes]":
    command = [sys.executable, "-P", "-m", "bender_cli", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, check=False, timeout=120)


@pytest.mark.skipif(os.name == "nt", reason="devices of POSIX")
@pytest.mark.parametrize("command", [("fmu", "check"), ("calibrate",)])
@pytest.mark.parametrize("what", ["/dev/zero", "pipe"])
def test_what_has_no_end_is_not_read(command: Sequence[str], what: str, tmp_path: Path, capsys) -> None:
    if command == ("calibrate",):
        pytest.importorskip("cv2")
    if what == "pipe":
        os.mkfifo(tmp_path / "pipe")
        what = str(tmp_path / "pipe")
    refused(capsys, [*command, what], "expected a", tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="names that are no text need a file system that takes them")
@pytest.mark.parametrize(
    ("command", "out", "made"),
    [("compare", "out", "out/comparison.json"), ("identify", "model.toml", "model-loops.png")],
)
def test_a_file_name_that_is_no_text_is_a_name(command: str, out: str, made: str, tmp_path: Path) -> None:
    name = os.fsencode(tmp_path) + b"/r\xff.csv"
    os.rename(record(tmp_path / "r.csv"), name)
    done = _child([command, name, "--out", out], tmp_path)
    assert (done.returncode, b"fault" in done.stderr) == (0, False)
    assert (tmp_path / made).stat().st_size > 100
    assert _child(["fmu", "check", b"no\xff.fmu"], tmp_path).returncode == 2


@pytest.mark.skipif(os.name == "nt", reason="Windows keeps a working folder")
def test_a_working_folder_that_was_removed_is_said(tmp_path: Path) -> None:
    code = "import os, sys; os.rmdir(os.getcwd()); from bender_cli.start import entry; entry()"
    (tmp_path / "gone").mkdir()
    command = [sys.executable, "-P", "-c", code, "compare", "x.csv"]
    done = subprocess.run(command, cwd=tmp_path / "gone", capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.splitlines() == ["bender: the working folder has been removed; change to one that is there"]


FOREIGN_TABLE = "t;U;d\n0,0;0,0;0,0\n0,1;1,0;0,4\n0,2;2,0;0,9\n"


def test_how_a_table_was_read_is_told_unless_it_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    (tmp_path / "a.csv").write_text(FOREIGN_TABLE)
    assert main(["diagnose", str(tmp_path / "a.csv")]) == 2
    assert len(capfd.readouterr().err.splitlines()) == 1
    assert main(["compare", str(tmp_path / "a.csv"), "--out", str(tmp_path / "out")]) == 0
    assert "decimal comma" in capfd.readouterr().err
    assert main(["compare", str(tmp_path / "a.csv"), "--out", str(tmp_path / "quiet"), "--quiet"]) == 0
    assert "decimal comma" not in capfd.readouterr().err
