"""`bender diagnose` as people call it: what it writes, prints and refuses, and that it leaves nothing half done."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description
from reported_diagnosis import levels, record_of

from bender_cli.main import main
from bender_discrepancy.output_folder import all_or_no_files
from bender_loop.errors import InputError
from bender_loop.records.record import write_record
from bender_plant.model import model_from_table

FILES = {"diagnosis.json", "model.toml", "model.fmu", "report.html"}
HEADER = "time_s,voltage_V,displacement_um\n"


def child(*words: object, cwd: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "bender_cli", "diagnose", *map(str, words)]
    return subprocess.Popen(command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_a_missing_effect_is_named_and_everything_written(tmp_path: Path):
    record = record_of(effects={"source_resistance": {"time_constant_s": 0.03}}, voltage_V=levels(12.0))
    write_record(tmp_path / "camera.csv", record)
    running = child("camera.csv", "--json", cwd=tmp_path)
    out, err = running.communicate()
    assert running.returncode == 0, err
    folder = tmp_path / "results" / "diagnose-camera"
    assert {path.name for path in folder.iterdir()} == FILES
    result = json.loads(out)
    assert result == json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    assert [effect["id"] for effect in result["effects"]] == ["source_resistance"]
    assert result["verdict"] == "named"
    assert result["effects"][0]["parameters"]["time_constant_s"]["value"] == pytest.approx(0.03, rel=0.02)
    assert result["gap"]["after"]["rms_um"] < 1.2 * result["gap"]["noise_floor_um"]
    import tomllib

    model = model_from_table(tomllib.loads((folder / "model.toml").read_text(encoding="utf-8")))
    assert model.values()["source_resistance.time_constant"] == pytest.approx(0.03, rel=0.02)
    variables = {x.name: x.causality for x in read_model_description(str(folder / result["fmu"])).modelVariables}
    assert (variables["voltage"], variables["displacement"], variables["tip_displacement"]) == (
        "input", "output", "output",
    )  # fmt: skip
    assert variables["source_resistance.time_constant"] == "parameter"


@pytest.mark.slow
def test_records_of_another_device_get_no_corrected_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    write_record(Path("other.csv"), record_of(voltage_V=levels(8.0), gain=20.0))
    assert main(["diagnose", "other.csv", "--json", "--out", "mine"]) == 0
    said = capsys.readouterr()
    assert "this looks like another device than paper" in said.err
    result = json.loads(said.out)
    assert (result["model"], result["fmu"]) == (None, None)
    assert "another device" in result["warnings"][0]
    assert {path.name for path in Path("mine").iterdir()} == {"diagnosis.json", "report.html"}


def rows(time_s: np.ndarray, voltage_V: np.ndarray, displacement_um: np.ndarray) -> str:
    table = zip(time_s.tolist(), voltage_V.tolist(), displacement_um.tolist(), strict=True)
    return HEADER + "".join(",".join(map(repr, row)) + "\n" for row in table)


def good(count: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    record = record_of(voltage_V=levels()[:count])
    return record.time_s.copy(), record.voltage_V.copy(), record.displacement_um.copy()


STILL = """\
format = 1
name = "still"
[[block]]
id = "linear_transduction"
sensitivity_um_per_V = 0.0
"""


def constant() -> str:
    time_s, voltage_V, displacement_um = good()
    return rows(time_s, np.full_like(voltage_V, 5.0), displacement_um)


def all_lost() -> str:
    time_s, voltage_V, displacement_um = good()
    return rows(time_s, voltage_V, np.full_like(displacement_um, np.nan))


def in_metres() -> str:
    time_s, voltage_V, displacement_um = good()
    return rows(time_s, voltage_V, 1e-6 * displacement_um)


def seconds_in_microseconds() -> str:
    time_s, voltage_V, displacement_um = good()
    return rows(1e6 * time_s, voltage_V, displacement_um)


def volts_in_microvolts() -> str:
    time_s, voltage_V, displacement_um = good()
    return rows(time_s, 1e6 * voltage_V, displacement_um)


def dead() -> str:
    time_s, voltage_V, displacement_um = good()
    return rows(time_s, voltage_V, np.ones_like(displacement_um))


@pytest.mark.parametrize(
    ("text", "options", "complaint"),
    [
        (None, [], "record.csv"),
        (constant(), [], "column voltage_V: found 5 V in every row from line 2 on"),
        (rows(*good(3)), [], "found 3 readings in 3 rows, expected at least 40"),
        (all_lost(), [], "found 0 readings in 60 rows, 60 of them lost"),
        (in_metres(), [], "--units"),
        (seconds_in_microseconds(), [], "line 3, column time_s: found a row 3.33e+04 s after the one before"),
        (volts_in_microvolts(), [], "voltage_V reaches 2e+07 V"),
        (dead(), [], "expected readings that change"),
        (rows(*good()), ["--model", "no_such"], "no_such"),
        (rows(*good()), ["record.csv"], "found the readings of record.csv again"),
        (rows(*good()), ["--model", "still.toml"], "does not move under the voltage"),
        (rows(*good()), ["--out", "record.csv"], "record.csv"),
        (rows(*good()), ["--out", "record.csv/below/it"], "record.csv"),
        (rows(*good()), ["--input-hold", "bent"], "--input-hold"),
        (rows(*good()), ["--units", "s,furlong,um"], "furlong"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    text: str | None,
    options: list[str],
    complaint: str,
):
    monkeypatch.chdir(tmp_path)
    if text is not None:
        Path("record.csv").write_text(text, encoding="utf-8")
    Path("still.toml").write_text(STILL, encoding="utf-8")
    before = set(tmp_path.rglob("*"))
    assert main(["diagnose", "record.csv", *options, "--quiet"]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert complaint in err
    assert set(tmp_path.rglob("*")) == before


def test_a_stage_replaces_what_it_makes_and_nothing_else(tmp_path: Path):
    out = tmp_path / "a" / "b"
    with all_or_no_files(out) as stage:
        (stage / "new.txt").write_text("1")
        assert not out.exists()
    assert [path.name for path in out.iterdir()] == ["new.txt"]
    (out / "old.txt").write_text("mine")
    with all_or_no_files(out) as stage:
        (stage / "new.txt").write_text("2")
    assert {path.name: path.read_text() for path in out.iterdir()} == {"new.txt": "2", "old.txt": "mine"}


def test_a_stage_that_fails_vanishes_with_what_was_made_for_it(tmp_path: Path):
    def fail() -> None:
        with all_or_no_files(tmp_path / "a" / "b" / "c") as stage:
            (stage / "half.txt").write_text("1")
            raise InputError("no")

    with pytest.raises(InputError, match="no"):
        fail()
    assert list(tmp_path.iterdir()) == []
