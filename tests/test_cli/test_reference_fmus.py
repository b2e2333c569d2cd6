"""The Reference-FMUs of the Modelica Association through the commands that take FMUs."""

import json
from pathlib import Path

import pytest
from few import few

from bender_cli.main import main

FOLDER = Path(__file__).parents[3] / "shared" / "data" / "reference-fmus"
RECORD = "time_s,voltage_V,displacement_um\n" + "".join(f"{0.1 * k:.1f},{k % 3},{k % 3 * 1.1}\n" for k in range(12))
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="the Reference-FMUs are not beside the checkout")


@pytest.fixture(autouse=True)
def record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("record.csv").write_text(RECORD)


@pytest.mark.parametrize("version", few(["fmi2", "fmi3"], 1))
@pytest.mark.parametrize("name", few(["BouncingBall", "Dahlquist", "Stair", "VanDerPol"], 1))
def test_those_without_an_input(version: str, name: str, capsys: pytest.CaptureFixture[str]):
    path = str(FOLDER / version / f"{name}.fmu")
    assert main(["fmu", "check", path]) == 0
    assert "no findings" in capsys.readouterr().out
    for words in (["compare", "record.csv"], ["tune"]):
        assert main([*words, "--fmu", path, "--out", "o"]) == 2
        assert "found no input that is one real number" in capsys.readouterr().err
    assert not Path("o").exists()


@pytest.mark.slow
@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
def test_the_one_with_inputs(version: str, capsys: pytest.CaptureFixture[str]):
    path = str(FOLDER / version / "Feedthrough.fmu")
    assert main(["fmu", "check", path]) == 1
    assert "1 finding" in capsys.readouterr().out
    for words in (["compare", "record.csv"], ["tune", "--evaluations", "30"]):
        assert main([*words, "--fmu", path, "--out", "o"]) == 2
        assert "Float64_continuous_input" in capsys.readouterr().err
        ports = ["--input", "Float64_continuous_input", "--output", "Float64_continuous_output"]
        assert main([*words, "--fmu", path, *ports, "--out", words[0]]) == 0
        assert list(Path(words[0]).iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
def test_an_output_without_unit_is_said_and_can_be_named(version: str, capsys: pytest.CaptureFixture[str]):
    ports = ["--input", "Float64_continuous_input", "--output", "Float64_continuous_output"]
    words = ["tune", "--method", "simc", "--fmu", str(FOLDER / version / "Feedthrough.fmu"), *ports]
    assert main([*words, "--setpoint=-10"]) == 2
    assert "Float64_continuous_output, taken as m; for another one say, for example, --units V,um" in (
        capsys.readouterr().err
    )
    assert main([*words, "--units", "V,um", "--out", "named"]) == 0
    assert "Float64_continuous_output, taken as um" in capsys.readouterr().out
    taken = json.loads(Path("named/tuning.json").read_text(encoding="utf-8"))["fmu"]["taken_units"]
    assert taken == {"Float64_continuous_input": "V", "Float64_continuous_output": "um"}


@pytest.mark.parametrize(("units", "found"), [("um", "'um'"), ("V,um,s", "'V,um,s'"), ("", "''")])
def test_units_that_cannot_be(units: str, found: str, capsys: pytest.CaptureFixture[str]):
    assert main(["tune", "--fmu", str(FOLDER / "fmi2" / "Feedthrough.fmu"), "--units", units, "--out", "o"]) == 2
    assert f"--units: found {found}" in capsys.readouterr().err
    assert not Path("o").exists()
