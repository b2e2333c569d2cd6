import os
import platform
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import tomli_w

from bender_export import build
from bender_export.archive import guid_of
from bender_loop.errors import InputError, RunError
from bender_plant.model import load_model


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
        build.build_controller_fmu(tmp_path / name)
