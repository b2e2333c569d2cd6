"""FMUs are built: the same bytes from the same model, what is stale anew, by the script too, with their origin."""

import os
import platform
import shutil
import subprocess
import sys
import time
import zipfile
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import pytest
import tomli_w
from fmpy import read_model_description, simulate_fmu
from fmu_hosts import loaded

from bender_cli.main import main
from bender_export import build
from bender_export.archive import guid_of
from bender_export.assembly import plant_parts
from bender_export.origin import device_name, facts_of, generation_date
from bender_loop.control.pid import Gains, Limits
from bender_loop.errors import InputError, RunError
from bender_native.description import fmi3_description
from bender_plant.model import Model, ModelError, load_model, model_from_table
from bender_plant.origin import Origin
from bender_plant.valid_range import ValidRange
from bender_plant.variables import variables
from bender_tuner.results.gains_file import write_gains


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Stand for the `fmu/` of the checkout, with a cache beside it."""
    monkeypatch.setattr(build, "checkout_folder", lambda: tmp_path / "fmu")
    monkeypatch.setattr(build, "cache_folder", lambda: tmp_path / "cache")
    (tmp_path / "fmu").mkdir()
    return tmp_path / "fmu"


def names_in(path: Path) -> set[str]:
    with zipfile.ZipFile(path) as archive:
        return {name.split("/")[1] for name in archive.namelist() if name.startswith("resources/")}


def test_same_model_same_bytes(plant_fmu: Path, controller_fmu: Path) -> None:
    assert build.plant_fmu(load_model("paper")) == plant_fmu.read_bytes()
    assert build.controller_fmu() == controller_fmu.read_bytes()


def test_a_changed_parameter_changes_guid_and_every_name_that_could_clash(plant_fmu: Path, tmp_path: Path) -> None:
    changed = load_model("paper").with_values({"calibration.gain": 1.0 + 2.0**-52})
    other = build.build_plant_fmu(changed, tmp_path / "other.fmu")
    assert guid_of(other) != guid_of(plant_fmu)
    assert names_in(other) & names_in(plant_fmu) == {"model.toml", "pythonfmu", "slavemodule.txt"}


def test_the_model_goes_along(plant_fmu: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(plant_fmu) as archive:
        archive.extract("resources/model.toml", tmp_path)
    assert load_model(tmp_path / "resources" / "model.toml") == load_model("paper")


def test_building_leaves_no_trace_in_the_process(tmp_path: Path) -> None:
    path = sys.path[:]
    model = load_model("beam").with_values({"calibration.gain": 1.5})
    made = build.build_plant_fmu(model, tmp_path / "beam.fmu")
    hashed = {name.removesuffix(".py") for name in names_in(made)} - {"pythonfmu"}
    assert sys.path == path
    assert hashed.isdisjoint(name.partition(".")[0] for name in sys.modules)


def test_ensure_builds_what_is_missing_or_stale_and_only_that(folder: Path, plant_fmu: Path, beam_fmu: Path) -> None:
    made = build.ensure_plant_fmu("paper")
    assert made == folder / "PiezoBender.fmu"
    assert made.read_bytes() == plant_fmu.read_bytes()
    before = made.stat().st_mtime_ns
    assert build.ensure_plant_fmu("paper") == made
    assert made.stat().st_mtime_ns == before
    made.write_bytes(beam_fmu.read_bytes())
    assert build.ensure_plant_fmu("paper").read_bytes() == plant_fmu.read_bytes()
    made.write_bytes(b"cut short")
    assert build.ensure_plant_fmu("paper").read_bytes() == plant_fmu.read_bytes()


def test_ensure_knows_other_models_and_the_controller(folder: Path, tmp_path: Path) -> None:
    assert build.ensure_plant_fmu("beam") == folder / "PiezoBender-beam.fmu"
    assert build.ensure_controller_fmu() == folder / "PidController.fmu"
    model = load_model("paper").with_values({"bending_modes.damping_ratio": 0.05})
    file = tmp_path / "mine.toml"
    file.write_text(tomli_w.dumps(model.to_table()), encoding="utf-8")
    made = build.ensure_plant_fmu(file)
    assert made.parent == tmp_path / "cache"
    assert build.ensure_plant_fmu(str(file)) == made


def test_ensure_falls_back_on_the_cache_where_the_checkout_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "no_folder").write_text("a file", encoding="utf-8")
    monkeypatch.setattr(build, "checkout_folder", lambda: tmp_path / "no_folder")
    monkeypatch.setattr(build, "cache_folder", lambda: tmp_path / "cache")
    assert build.ensure_controller_fmu() == tmp_path / "cache" / "PidController.fmu"


def test_an_up_to_date_fmu_is_found_without_pythonfmu(tmp_path: Path, controller_fmu: Path) -> None:
    shutil.copy(controller_fmu, tmp_path / "PidController.fmu")
    code = (
        "import sys; from pathlib import Path; from bender_export import build;"
        "build.checkout_folder = lambda: Path(sys.argv[1]); build.ensure_controller_fmu();"
        "print({'pythonfmu', 'numpy', 'fmpy'} & set(sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.stdout == "set()\n", done.stderr


def test_two_processes_at_once(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from bender_export import build;"
        "build.checkout_folder = lambda: Path(sys.argv[1]); print(build.ensure_controller_fmu())"
    )
    both = [
        subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    paths = [process.communicate(timeout=60)[0].strip() for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert paths == [str(tmp_path / "PidController.fmu")] * 2
    assert os.listdir(tmp_path) == ["PidController.fmu"]
    assert Path(paths[0]).read_bytes() == build.controller_fmu()


def test_a_platform_without_library_is_told_what_still_works(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, "system", lambda: "Darwin")
    monkeypatch.setattr(platform, "machine", lambda: "arm64")
    with pytest.raises(RunError, match=r"no library for Darwin arm64.*can be built here and run there"):
        build.ensure_plant_fmu()


@pytest.mark.parametrize(("name", "found"), [("plant.zip", r"the ending '\.zip'"), ("folder.fmu", "a directory")])
def test_a_name_that_no_fmu_can_bear_is_refused(tmp_path: Path, name: str, found: str) -> None:
    (tmp_path / "folder.fmu").mkdir()
    with pytest.raises(InputError, match=f"{name}: found {found}"):
        build.build_plant_fmu(load_model("paper"), tmp_path / name)


SCRIPT = Path(__file__).parents[2] / "build_fmu.py"


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, with a checkout of its own."""
    module = loaded(SCRIPT)
    monkeypatch.setattr(module, "ROOT", tmp_path / "checkout")
    return module


def test_it_writes_both_fmus_and_their_loop(
    script: ModuleType, tmp_path: Path, plant_fmu: Path, controller_fmu: Path
) -> None:
    assert script.main([]) == 0
    written = sorted((tmp_path / "checkout" / "fmu").iterdir())
    assert [path.name for path in written] == ["ClosedLoop.ssp", "PidController.fmu", "PiezoBender.fmu"]
    assert [path.read_bytes() for path in written[1:]] == [controller_fmu.read_bytes(), plant_fmu.read_bytes()]
    with zipfile.ZipFile(written[0]) as loop:
        assert loop.read("resources/PiezoBender.fmu") == plant_fmu.read_bytes()


@pytest.mark.parametrize(
    ("model", "out", "words"),
    [
        ("no_such.toml", "plant.fmu", ["no_such.toml", "expected"]),
        ("broken.toml", "plant.fmu", ["broken.toml", "beam.length_m", "-1.0", "expected"]),
        ("paper", "a_file/plant.fmu", ["a_file"]),
        ("paper", "plant.toml", ["plant.toml", "'.toml'", ".fmu"]),
        ("paper", "checkout/fmu/../fmu/PidController.fmu", ["place of the controller FMU", "another name"]),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(
    script: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str], model: str, out: str, words: list[str]
) -> None:
    (tmp_path / "a_file").write_text("", encoding="utf-8")
    source = SCRIPT.parent / "plant_src" / "bender_plant" / "models" / "paper.toml"
    text = source.read_text(encoding="utf-8").replace("length_m = 0.0125", "length_m = -1.0")
    (tmp_path / "broken.toml").write_text(text, encoding="utf-8")
    before = sorted(tmp_path.iterdir())
    given = model if model == "paper" else str(tmp_path / model)
    assert script.main(["--model", given, "--out", str(tmp_path / out)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    for word in words:
        assert word in said.err
    assert sorted(tmp_path.iterdir()) == before


def test_exit_status_reaches_the_shell() -> None:
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--model", "no_such_model"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


def test_a_checkout_that_cannot_be_written_gets_its_controller_beside_the_plant(
    script: ModuleType, tmp_path: Path
) -> None:
    (tmp_path / "checkout").write_text("no folder", encoding="utf-8")
    assert script.main(["--model", "beam", "--out", str(tmp_path / "new" / "mine.fmu")]) == 0
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["PidController.fmu", "mine.fmu", "mine.ssp"]


ORIGIN = Origin(("monday.csv", "tuesday.csv"), ("gain: 0.95 ± 0.01 (95 %)",), "W", "K", report="report.html")


@pytest.fixture
def oven() -> Model:
    return replace(load_model("beam"), name="oven 3", valid=ValidRange(0.0, 400.0, 3600.0), origin=ORIGIN)


def test_the_date_is_that_of_the_day_or_the_one_that_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH")
    made = time.mktime(time.strptime(generation_date(), "%Y-%m-%dT%H:%M:%SZ")) - time.timezone
    assert abs(made - time.time()) < 60.0
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    assert generation_date() == "1970-01-02T00:00:00Z"
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    with pytest.raises(InputError, match="SOURCE_DATE_EPOCH: found 'yesterday', expected a whole number of seconds"):
        generation_date()


def test_what_a_volt_and_a_micrometre_stand_for_is_said(oven: Model) -> None:
    command, reading = ORIGIN.command_unit, ORIGIN.reading_unit
    told = {x.name: x.description for x in variables(oven)}
    assert f"1 V stands for 1 {command} of the records" in told["voltage"]
    assert f"1 um stands for 1 {reading} of the records" in told["displacement"]
    assert not any("stands for" in x.description for x in variables(load_model("beam")))


def test_the_model_file_carries_its_origin(oven: Model) -> None:
    assert model_from_table(oven.to_table()) == oven


@pytest.mark.parametrize(
    ("origin", "said"),
    [
        ({"records": "one.csv"}, r"origin\.records: found 'one\.csv', expected a list of texts"),
        ({"report": "../secret"}, r"origin\.report: found '\.\./secret', expected the name of a file beside"),
        ({"author": "me"}, r"origin\.author: unknown key"),
    ],
)
def test_an_origin_that_cannot_be_is_refused(origin: dict[str, object], said: str) -> None:
    with pytest.raises(ModelError, match=said):
        model_from_table(load_model("paper").to_table() | {"origin": origin})


def test_an_fmu_is_called_as_the_device(oven: Model) -> None:
    assert [device_name(load_model(x)) for x in ("paper", "beam")] == ["PiezoBender", "PiezoBender"]
    description, page, _ = plant_parts(oven, "{0}")
    assert ElementTree.fromstring(fmi3_description("PiezoBender", description)).get("modelName") == "oven 3"
    text = page.decode()
    for said in ("<h1>oven 3</h1>", "monday.csv", "0 to 400 W over 3600 s", "0.95 ± 0.01", 'href="report.html"'):
        assert said in text
    assert ("Units", ("1 V of the command stands for 1 W", "1 um of the reading stands for 1 K")) in facts_of(oven)


def test_the_report_beside_the_model_file_goes_into_the_fmu(oven: Model, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text("<p>what was found</p>", encoding="utf-8")
    file = tmp_path / "oven.toml"
    file.write_text(tomli_w.dumps(oven.to_table()), encoding="utf-8")
    plant, *_ = build.build_all(file, tmp_path / "out" / "oven.fmu", tmp_path / "out")
    with zipfile.ZipFile(plant) as archive:
        assert archive.read("documentation/report.html") == b"<p>what was found</p>"
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    assert (root.get("modelName"), root.get("generationDateAndTime")) == ("oven 3", generation_date())


@pytest.fixture
def oven_gains(tmp_path: Path) -> Path:
    path = tmp_path / "oven.toml"
    write_gains(path, Gains(13.0, 0.5), Limits(0.0, 200.0), 2.0, units=("W", "K"))
    return path


def test_the_controller_of_another_device_takes_and_gives_its_units(
    oven_gains: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["fmu", "build", "--gains", str(oven_gains), "--out", str(out)]) == 0
    assert os.listdir(out) == ["PidController.fmu"]
    assert "takes and gives W and K; no plant and no loop" in capsys.readouterr().err
    path = out / "PidController.fmu"
    units = {x.name: x.unit for x in read_model_description(str(path)).modelVariables}
    assert [units[x] for x in ("setpoint", "measurement", "command", "limits.upper")] == ["K", "K", "W", "W"]
    assert [units[f"gains.{x}"] for x in ("proportional", "integral", "derivative")] == ["W/K", "W/(K.s)", "W.s/K"]
    found = simulate_fmu(
        str(path), stop_time=2.0, step_size=2.0, output_interval=2.0, output=["command"],
        start_values={"setpoint": 5.0, "measurement": 1.0},
    )  # fmt: skip
    assert found["command"][-1] == pytest.approx(13.0 * 4.0 + 0.5 * 2.0 * 4.0)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("fmu build --native", "found gains in W and K with --native"),
        ("simulate paper", "found gains in W and K, expected V and µm, the units of paper"),
    ],
)
def test_gains_of_another_device_are_neither_made_native_nor_simulated_on_the_actuator(
    words: str, said: str, oven_gains: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words.split(), "--gains", str(oven_gains), "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
