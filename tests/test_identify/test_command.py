import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from lxml import html

from bender_identify.command import KEPT_NAMES, LIBRARY_NAMES
from bender_identify.settings import KEEP, LIBRARIES
from bender_loop.errors import InputError
from bender_loop.records.record import Record, read_record, write_record
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


@pytest.mark.slow
def test_the_report_is_whole_by_itself(identify_command: Command, record_file: Path, tmp_path: Path) -> None:
    words = [str(record_file), "--out", str(tmp_path / "m.toml"), "--library", "paper", "--ensemble", "0"]
    identify_command(words)
    page = html.fromstring((tmp_path / "m-report.html").read_text(encoding="utf-8"))
    assert page.xpath("//img/@src")[0].startswith("data:image/png;base64,")
    assert not page.xpath("//script | //link")
    rows = page.xpath("//table[1]//tr")
    assert len(rows) >= 4
    assert "w' = " in page.xpath("//div[@class='formula']")[0].text_content()


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
    ],
)
def test_bad_options_are_refused_in_one_line(
    identify_command: Command, record_file: Path, tmp_path: Path, words: list[str], says: str
) -> None:
    with pytest.raises(InputError) as caught:
        identify_command([str(record_file), "--out", str(tmp_path / "m.toml"), *words])
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.glob("m*"))


def test_a_record_named_twice_is_refused(identify_command: Command, record_file: Path, tmp_path: Path) -> None:
    twice = record_file.parent / "." / ".." / record_file.parent.name / record_file.name
    for words in ([str(twice)], ["--held-out", str(twice)]):
        with pytest.raises(InputError, match="named twice"):
            identify_command([str(record_file), *words, "--out", str(tmp_path / "m.toml")])
    assert not list(tmp_path.glob("m*"))


def test_the_choices_of_the_options_are_those_of_the_settings() -> None:
    assert set(LIBRARY_NAMES) == {"auto", *LIBRARIES}
    assert KEPT_NAMES == KEEP
