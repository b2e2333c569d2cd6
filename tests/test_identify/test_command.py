"""`bender identify`: what it writes and refuses, on simulated records and on measurements by others."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bender_identify.identification import identify
from bender_identify.identification_result import Identification
from bender_identify.records.experiment import experiment_of
from bender_identify.settings import LIBRARIES, Settings
from bender_loop.errors import InputError
from bender_loop.records.record import Record, read_record, write_record
from bender_plant.blocks.sparse_equation import powers_of
from bender_plant.model import load_model

Command = Callable[[list[str]], int]

DRIVE_FMU = """
import sys, json
from pathlib import Path
from bender_export.build import build_plant_fmu
from bender_loop.records.drive import drive_record
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.record import read_record
from bender_plant.model import load_model
model, record, fmu = (Path(x) for x in sys.argv[1:])
with FmuPlant(build_plant_fmu(load_model(model), fmu)) as plant:
    print(json.dumps(drive_record(plant, read_record(record)).tolist()))
"""


@pytest.fixture
def record_file(tmp_path: Path, held_record: Callable[..., Record]) -> Path:
    volts = np.repeat(np.random.default_rng(4).uniform(0.0, 50.0, 20), 15)
    path = tmp_path / "stairs.csv"
    write_record(path, held_record("paper", volts, noise_um=0.05))
    return path


def test_everything_is_written_and_the_fmu_carries_the_model(
    identify_command: Command, record_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "learned.toml"
    words = [str(record_file), "--out", str(out), "--library", "paper", "--ensemble", "5"]
    assert identify_command(words) == 0
    said = capsys.readouterr().out
    assert "w' = " in said
    assert "held-out error %" in said
    names = {path.name for path in out.parent.iterdir()}
    assert names == {"learned.toml", "learned-report.html", "learned-loops.png", "learned-figures.json"}
    figures = json.loads((out.parent / "learned-figures.json").read_text())
    assert figures["written"] == "sindy"
    model = load_model(out)
    done = subprocess.run(
        [sys.executable, "-c", DRIVE_FMU, str(out), str(record_file), str(tmp_path / "learned.fmu")],
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    from bender_compiled.simulation import Drive, Simulator

    record = read_record(record_file)
    ours = Simulator(Drive.of_rows(record.time_s, record.voltage_V)).run(model).reading_um
    assert np.max(np.abs(np.array(json.loads(done.stdout)) - ours)) < 1e-3
    rms = float(np.sqrt(np.mean((record.displacement_um - ours) ** 2)))
    assert rms == pytest.approx(0.05, rel=0.3)


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("time_s,voltage_V,displacement_um\n" + "".join(f"{k},5,{k}\n" for k in range(50)), "excites nothing"),
        ("time_s,voltage_V,displacement_um\n" + "".join(f"{k},{k % 7},3\n" for k in range(50)), "stays at 3 µm"),
        ("time_s,voltage_V,displacement_um\n0,0,0\n1,1,1\n", "2 readings"),
        ("time_s,voltage_V\n0,0\n1,1\n", "displacement_um"),
        ("", "empty"),
        (
            "time_s,voltage_V,displacement_um\n" + "".join(f"{k},{k % 7}e9,{k % 7}\n" for k in range(50)),
            "voltage_V reaches 6e.09 V, expected at most 100000 V",
        ),
    ],
)
def test_a_record_that_cannot_teach_is_refused_and_nothing_is_written(
    identify_command: Command, tmp_path: Path, rows: str, says: str
) -> None:
    record = tmp_path / "bad.csv"
    record.write_text(rows)
    with pytest.raises(InputError, match=says):
        identify_command([str(record), "--out", str(tmp_path / "out" / "m.toml")])
    assert [path.name for path in tmp_path.iterdir()] == ["bad.csv"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--model", "nothing.toml"], "--model: nothing.toml"),
        (["--terms", "w, tan"], "--terms: found 'tan'"),
        (["--ensemble", "-1"], "--ensemble: found -1"),
        (["--delay", "soon"], "--delay: found 'soon'"),
        (["--held-out-share", "2"], "--held-out-share: found 2.0"),
        (["--set-aside", "-1"], "--set-aside: found -1.0"),
        (["--seed", "-1"], "--seed: found -1"),
        (["--held-out", "missing.csv"], "missing.csv"),
        (["--terms", "w, u", "--untimed"], "terms that run with time"),
        (["--out", "stairs.csv"], "--out: found stairs.csv, expected the name of a file that ends with .toml"),
        *((words, "named twice") for words in (["stairs.csv"], ["--held-out", "sub/../stairs.csv"])),
    ],
)
def test_bad_options_are_refused_in_one_line(
    identify_command: Command,
    record_file: Path,
    tmp_path: Path,
    words: list[str],
    says: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    with pytest.raises(InputError) as caught:
        identify_command(["--out", str(tmp_path / "m.toml"), str(record_file), *words])
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.glob("m*"))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"library": "fourier"}, "library: found 'fourier'"),
        ({"keep": "best"}, "keep: found 'best'"),
        ({"delay_s": -0.1}, "delay_s: found -0.1"),
        ({"terms": ("w", "sin(u)")}, "sin"),
        ({"terms": ("w u", "u w")}, "each term once"),
    ],
)
def test_settings_that_cannot_be_are_refused(change: dict, says: str) -> None:
    with pytest.raises(ValueError, match=says.replace("(", "\\(").replace(")", "\\)")):
        Settings(**change)


def test_own_terms_replace_the_libraries_which_name_each_term_once() -> None:
    assert Settings(library="paper", terms=("u'", "w")).libraries() == {"own": ("u'", "w")}
    assert list(Settings().libraries()) == ["bouc_wen", "paper", "combined"]
    for terms in LIBRARIES.values():
        assert len({powers_of(term) for term in terms}) == len(terms)


@pytest.fixture(scope="module")
def stack(measured_data: Path) -> Identification:
    settings = Settings(library="paper", ensemble=0, held_out_share=0.5)
    experiment = experiment_of(read_record(measured_data / "piezo_stack_1Hz.csv"), "piezo_stack_1Hz.csv", settings)
    return identify([experiment], load_model("paper"), settings, np.random.default_rng(0))


@pytest.mark.slow
def test_a_piezo_stack_is_met_by_an_operator(stack: Identification) -> None:
    rows = {row.candidate.id: row for row in stack.rows}
    assert rows["prandtl_ishlinskii"].held_out.error_percent <= 2.5
    assert rows["prandtl_ishlinskii"].remanent
    assert 0.2 < stack.floor_percent < rows["prandtl_ishlinskii"].held_out.error_percent
    assert rows["prandtl_ishlinskii"].held_out.rms_um < rows["first_order_lag"].held_out.rms_um


def test_the_first_cycle_is_set_aside_and_the_offset_found(stack: Identification) -> None:
    experiment = stack.experiments[0]
    assert np.flatnonzero(experiment.fitted)[1] == pytest.approx(200, abs=2)
    assert not experiment.in_motion
    assert stack.written.candidate.fit.offset_um == pytest.approx(-123.0, abs=7.0)


def test_the_papers_own_actuator_has_no_times(measured_data: Path) -> None:
    settings = Settings(ensemble=0, held_out_share=0.2)
    record = read_record(measured_data / "paper_fig8.csv")
    experiment = experiment_of(record, "paper_fig8.csv", settings, untimed=True)
    outcome = identify([experiment], load_model("paper"), settings, np.random.default_rng(0))
    assert "first_order_lag" not in {row.candidate.id for row in outcome.rows}
    assert all("'" in term for term in outcome.learned.terms)
    assert outcome.written.fitted.error_percent < 6.0
