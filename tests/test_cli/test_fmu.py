"""`bender fmu` and `bender compare`, on FMUs and records that are right, broken or missing."""

import csv
import json
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from few import few_rows

from bender_cli.main import main
from bender_plant.model import load_model
from bender_plant.plant import Plant


@pytest.fixture
def broken_fmu(tmp_path: Path) -> Path:
    path = tmp_path / "broken.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription fmiVersion='2.0'/>")
    return path


def test_findings_are_printed_explained_and_counted(broken_fmu: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["fmu", "check", str(broken_fmu)]) == 1
    lines = capsys.readouterr().out.splitlines()
    found = [k for k, line in enumerate(lines) if f"{broken_fmu}: error: " in line]
    assert any("modelName" in lines[k] for k in found)
    for k in found:
        assert lines[k + 1].startswith("    why: ")
        assert lines[k + 2].startswith("    do:  ")
    assert f"{len(found)} findings" in lines[-1]
    assert any("left out: trial run: for co-simulation only" in line for line in lines)


def test_built_fmus_are_without_findings(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["fmu", "build", "--model", "beam", "--out", str(tmp_path / "new")]) == 0
    written = capsys.readouterr().out.splitlines()
    assert [Path(line).name for line in written] == ["PiezoBender.fmu", "PidController.fmu", "ClosedLoop.ssp"]
    for line in written[:2]:
        assert main(["fmu", "check", line]) == 0
        assert capsys.readouterr().out.splitlines()[-1] == f"{line}: no findings"


@pytest.mark.parametrize(
    ("name", "content"), [("missing.fmu", None), ("text.fmu", b"no zip"), ("folder.fmu", "folder")]
)
def test_what_is_no_fmu_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, content: bytes | str | None
):
    path = tmp_path / name
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        path.mkdir()
    assert main(["fmu", "check", str(path)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"bender: {path}: found no ")
    assert len(err.splitlines()) == 1


def test_archive_without_a_model_description_is_refused(tmp_path: Path):
    path = tmp_path / "empty.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "")
    assert main(["fmu", "check", str(path)]) == 2


def test_platforms_without_native_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["fmu", "build", "--out", str(tmp_path / "new"), "--platforms", "all", "--json"]) == 2
    out, err = capsys.readouterr()
    assert (out, len(err.splitlines())) == ("", 1)
    assert "--platforms: found without --native" in err
    assert not (tmp_path / "new").exists()


def test_the_loop_takes_the_gains_of_a_tuning(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    gains = tmp_path / "gains.toml"
    text = "sampling_period_s = 0.02\n[parallel]\nproportional_V_per_um = 0.5\nintegral_V_per_um_s = 6.5\n"
    gains.write_text(text, encoding="utf-8")
    assert main(["fmu", "build", "--gains", str(gains), "--out", str(tmp_path / "new")]) == 0
    with zipfile.ZipFile(tmp_path / "new" / "ClosedLoop.ssp") as archive:
        structure = archive.read("SystemStructure.ssd").decode()
    assert 'value="6.5"' in structure
    assert 'stepSize="0.02"' in structure
    gains.write_text("nothing = 1\n", encoding="utf-8")
    assert main(["fmu", "build", "--gains", str(gains), "--out", str(tmp_path / "other")]) == 2
    assert not (tmp_path / "other").exists()


DATA = Path(__file__).parents[3] / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the measured records are not beside this checkout")


def bender(*words: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "bender_cli", *map(str, words)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


def compared(directory: Path) -> dict:
    assert (directory / "overlay.png").read_bytes().startswith(b"\x89PNG")
    return json.loads((directory / "comparison.json").read_text(encoding="utf-8"))


def write(path: Path, header: str, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")
    return path


def kernel_reading(model: str, voltage_V: np.ndarray, step_s: float) -> np.ndarray:
    """The plant's own kernel, without FMI: the reading before each command acts."""
    plant = Plant(load_model(model))
    state, readings = plant.initial(), [0.0]
    for row, voltage in enumerate(voltage_V[:-1]):
        state, displacement_um, _ = plant.step(state, float(voltage), row * step_s, step_s)
        readings.append(displacement_um)
    return np.array(readings)


def static_paper_um(voltage_V: np.ndarray) -> np.ndarray:
    """Equation (30) at rest under u >= 0: 0.124 y^2 + 0.70 y = 1.652 u, solved by hand."""
    return (np.sqrt(0.49 + 4 * 0.124 * 1.652 * voltage_V) - 0.70) / (2 * 0.124)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def columns(name: str) -> tuple[np.ndarray, np.ndarray]:
    with (DATA / name).open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return tuple(np.array([float(row[c]) for row in rows]) for c in ("voltage_V", "displacement_um"))  # type: ignore


@pytest.mark.slow
def test_gain_and_offset_of_a_reading_are_found_again(tmp_path: Path):
    voltage_V = np.repeat([5.0, 20.0, 10.0, 50.0, 0.0], 12)
    reading = 2.0 * kernel_reading("paper", voltage_V, 1 / 30) + 3.0
    # 17 digits: the default of savetxt would round the times off their raster.
    record = write(tmp_path / "camera.csv", "t,U,d", np.arange(voltage_V.size) * 1000 / 30, voltage_V, reading / 1000)
    done = bender("compare", record, "--columns", "time=t,voltage=U,displacement=d", "--units", "ms,V,mm", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    facts = compared(tmp_path / "results" / "compare-camera")
    assert facts["recalibration"] == pytest.approx({"gain": 2.0, "offset_um": 3.0}, rel=1e-6)
    assert facts["recalibrated"]["rms_um"] < 1e-6
    assert facts["before"]["rms_um"] == pytest.approx(rms(reading - (reading - 3.0) / 2.0), rel=1e-6)
    assert "gain × 2" in done.stdout


@pytest.mark.parametrize(
    ("rows", "options", "complaint"),
    few_rows(
        [
            (None, [], "record.csv"),
            (["0,0,0", "1,x,1", "2,2,2"], [], "line 3, column voltage_V: found 'x'"),
            (["0,0,", "1,1,", "2,2,nan"], [], "0 readings in 3 rows"),
            (["0,0,0", "1,1,1", "2,2,2"], ["--model", "no_such_model"], "no_such_model"),
            (["0,0,0", "1,1,1", "2,2,2"], ["--model", "beam", "--fmu", "mine.fmu"], "both name a plant"),
            (["0,0,0", "1,1,1", "2,2,2e300"], [], "displacement_um reaches 2e+300 µm"),
            (["0,0,0", "1,1,1", "2,2,2"], ["--out", "record.csv/below"], "record.csv"),
            (["0,0,0", "1,1,1", "2,2,2"], ["--input-hold", "bent"], "--input-hold"),
        ],
        1,
        4,
    ),
)
def test_bad_input_is_one_line_and_leaves_nothing(
    tmp_path: Path, rows: list[str] | None, options: list[str], complaint: str
):
    if rows is not None:
        (tmp_path / "record.csv").write_text("\n".join(["time_s,voltage_V,displacement_um", *rows, ""]))
    before = set(tmp_path.rglob("*"))
    done = bender("compare", "record.csv", *options, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert complaint in done.stderr
    assert set(tmp_path.rglob("*")) == before


@pytest.mark.slow
@needs_data
def test_paper_record_against_the_beam_is_a_straight_line(tmp_path: Path):
    done = bender("compare", DATA / "paper_fig8.csv", "--untimed", "--model", "beam", "--out", tmp_path, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    facts = compared(tmp_path)
    voltage_V, measured_um = columns("paper_fig8.csv")
    slope, offset_um = np.polyfit(voltage_V, measured_um, 1)
    assert facts["before"]["rms_um"] == pytest.approx(rms(measured_um - 1.1488 * voltage_V), rel=1e-3)
    assert facts["recalibrated"]["rms_um"] == pytest.approx(rms(measured_um - slope * voltage_V - offset_um))
    assert facts["recalibration"]["gain"] == pytest.approx(slope / 1.1488, rel=1e-4)


@needs_data
def test_paper_record_against_the_paper_model_is_the_equation_at_rest(tmp_path: Path):
    done = bender("compare", DATA / "paper_fig8.csv", "--untimed", "--out", tmp_path, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    voltage_V, measured_um = columns("paper_fig8.csv")
    gap_um = measured_um - static_paper_um(voltage_V)
    before = compared(tmp_path)["before"]
    assert before["rms_um"] == pytest.approx(rms(gap_um), rel=1e-6)
    assert before["nrmse_percent"] == pytest.approx(100 * rms(gap_um) / np.ptp(measured_um), rel=1e-6)


@pytest.mark.slow
@needs_data
def test_stack_record_far_below_the_resonance_is_nearly_a_straight_line(tmp_path: Path):
    record = DATA / "piezo_stack_1Hz.csv"
    done = bender("compare", record, "--model", "beam", "--input-hold", "linear", "--out", tmp_path, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    voltage_V, measured_um = columns("piezo_stack_1Hz.csv")
    line = np.polyval(np.polyfit(voltage_V, measured_um, 1), voltage_V)
    assert compared(tmp_path)["recalibrated"]["rms_um"] == pytest.approx(rms(measured_um - line), rel=0.01)
