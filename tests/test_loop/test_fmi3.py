"""FMUs of FMI 3.0 as plants: the compiled plant in both versions gives the same numbers, and others' FMUs work."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from few import few
from native_hosts import needs_own_compiler

from bender_cli.main import main
from bender_loop.errors import InputError
from bender_loop.fmu.check.check import check
from bender_loop.fmu.plant import FmuPlant
from bender_loop.records.record import Record, write_record
from bender_native.build import native_plant_fmu, way
from bender_plant.model import load_model

REFERENCE = Path(__file__).parents[3] / "shared" / "data" / "reference-fmus" / "fmi3"
STEP_S = 0.01
VOLTS = 25.0 + 20.0 * np.sin(np.arange(60) / 7.0)

needs_reference = pytest.mark.skipif(not REFERENCE.is_dir(), reason="the Reference FMUs (../shared/data) are not here")


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """The beam with source resistance, compiled for FMI 2.0 and for 3.0."""
    folder = tmp_path_factory.mktemp("both")
    model = load_model("beam").with_block("source_resistance", time_constant_s=0.02)
    found = {}
    for version in (2, 3):
        found[version] = folder / f"plant{version}.fmu"
        found[version].write_bytes(native_plant_fmu(model, way(version)))
    return found


def _driven(plant: FmuPlant) -> list[float]:
    plant.reset()
    return [plant.step(float(volts), STEP_S) for volts in VOLTS]


@pytest.mark.slow
@needs_own_compiler
def test_both_versions_give_the_same_numbers(both: dict[int, Path]):
    with FmuPlant(both[2]) as two, FmuPlant(both[3]) as three:
        expected = _driven(two)
        assert _driven(three) == expected
        assert _driven(three) == expected  # from the restored state
        assert three.input.unit == two.input.unit == "V"
        for plant in (two, three):
            plant.set_parameters({"source_resistance.time_constant": 0.05})
        changed = _driven(three)
        assert changed == _driven(two)
        assert changed != expected
        assert three.read() == two.read()


@needs_own_compiler
def test_a_value_out_of_bounds_is_refused_with_its_bounds(both: dict[int, Path]):
    with (
        FmuPlant(both[3]) as plant,
        pytest.raises(InputError, match=r"source_resistance.time_constant.*expected at least"),
    ):
        plant.set_parameters({"source_resistance.time_constant": -1.0})


@pytest.mark.slow
@needs_own_compiler
def test_tune_gives_the_same_gains(both: dict[int, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    gains = {}
    for version, path in both.items():
        out = tmp_path / str(version)
        words = ["--method", "bas", "--evaluations", "40", "--duration", "0.5", "--seed", "3"]
        assert main(["tune", "--fmu", str(path), *words, "--out", str(out)]) == 0
        gains[version] = tomllib.loads((out / "gains.toml").read_text(encoding="utf-8"))
    capsys.readouterr()
    assert gains[2]["isa"] == gains[3]["isa"]


@needs_own_compiler
def test_the_check_runs_it_too(both: dict[int, Path]):
    report = check(both[3])
    assert "trial run" in report.ran
    assert not report.faults


@needs_reference
@pytest.mark.parametrize("name", few(["BouncingBall", "Dahlquist", "Stair", "VanDerPol"], 0))
def test_the_reference_fmus_without_inputs_are_checked_and_refused_as_plants(name: str):
    report = check(REFERENCE / f"{name}.fmu")
    assert "trial run" in report.ran
    assert not report.faults
    with pytest.raises(InputError, match="no input that is one real number"):
        FmuPlant(REFERENCE / f"{name}.fmu")


@needs_reference
def test_feedthrough_hands_its_input_on():
    given, taken = "Float64_continuous_input", "Float64_continuous_output"
    with FmuPlant(REFERENCE / "Feedthrough.fmu", input_name=given, output_name=taken) as plant:
        # no unit: an input in V, an output in m
        assert [plant.step(volts, STEP_S) for volts in (0.5, -2.0, 3.25)] == [0.5e6, -2e6, 3.25e6]
    with pytest.raises(InputError, match=r"\d+ Real inputs.*; choose one with --input NAME"):
        FmuPlant(REFERENCE / "Feedthrough.fmu")
    with pytest.raises(InputError, match="is a Int32 input"):
        FmuPlant(REFERENCE / "Feedthrough.fmu", input_name="Int32_input")


@pytest.mark.slow
@needs_reference
def test_compare_lays_one_of_fmi3_over_a_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    volts = np.repeat([0.0, 2.0, 1.0, 3.0], 10)
    write_record(tmp_path / "record.csv", Record(np.arange(volts.size) / 10, volts, 1e6 * np.roll(volts, 1)))
    words = [
        "--input",
        "Float64_continuous_input",
        "--output",
        "Float64_continuous_output",
        "--out",
        str(tmp_path / "o"),
    ]
    record, fmu = str(tmp_path / "record.csv"), str(REFERENCE / "Feedthrough.fmu")
    assert main(["compare", record, "--fmu", fmu, *words]) == 0
    capsys.readouterr()
    found = json.loads((tmp_path / "o" / "comparison.json").read_text(encoding="utf-8"))
    assert "Feedthrough" in json.dumps(found)
