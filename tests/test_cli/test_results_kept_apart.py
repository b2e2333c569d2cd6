"""A record of anybody's FMU needs no options, and results that answer another question stay where they can be found."""

import json
from pathlib import Path

import pytest
from foreign_fmus import needs_compiler, oscillator_fmu

from bender_cli.main import main

GAINS = """
sampling_period_s = 0.0333333333
[parallel]
proportional_V_per_um = 0.2
integral_V_per_um_s = 2.0
derivative_V_s_per_um = 0.0
filter_time_s = 0.06
derivative_on_error = false
[limits]
lower_V = 0.0
upper_V = 50.0
tracking_time_s = 0.0
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@needs_compiler
def test_columns_are_found_by_the_fmus_names_and_an_output_without_unit_is_in_that_of_the_record(
    capsys: pytest.CaptureFixture[str],
):
    fmu = oscillator_fmu(Path("oscillator.fmu").absolute())
    # settled long before the next row, and read before the command of its own row acts
    rows = "".join(f"{3 * k},7,{2.2 * (max(k - 1, 0) % 3)},{k % 3}\n" for k in range(40))
    Path("rig.csv").write_text(f"t [s],unused,y [bar],u [V]\n{rows}")
    assert main(["compare", "rig.csv", "--fmu", str(fmu), "--out", "o"]) == 0
    said = capsys.readouterr()
    assert "y: the FMU declares no unit for this output; it is taken in bar" in said.err
    found = json.loads(Path("o/comparison.json").read_text(encoding="utf-8"))
    assert found["recalibration"]["gain"] == pytest.approx(2.2, rel=1e-3)


def test_a_simulation_of_another_set_point_moves_the_earlier_one_away(capsys: pytest.CaptureFixture[str]):
    Path("gains.toml").write_text(GAINS)
    words = ["simulate", "beam", "--gains", "gains.toml", "--duration", "0.5", "--out", "o", "--setpoint"]
    assert main([*words, "3"]) == 0
    assert main([*words, "3"]) == 0
    assert not Path("o/earlier").exists()
    capsys.readouterr()
    assert main([*words, "5"]) == 0
    assert "were moved to o/earlier" in capsys.readouterr().err.replace("\\", "/")
    kept = json.loads(Path("o/earlier/loop.json").read_text(encoding="utf-8"))
    assert kept["provenance"]["command"].endswith("--setpoint 3")
    assert {x.name for x in Path("o/earlier").iterdir()} == {"loop.json", "loop.csv", "loop.png"}
