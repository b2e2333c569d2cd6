"""FMUs of other makers, here one in C: any units, with and without a state to restore, of even steps only."""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from few import few
from foreign_fmus import TAU_S, foreign_fmu, needs_compiler

from bender_cli.main import main
from bender_loop.errors import InputError, RunError
from bender_loop.fmu.check.check import check
from bender_loop.fmu.plant import FmuPlant

pytestmark = needs_compiler

MOVES = [(3.0, 0.02), (0.0, 0.02), (7.0, 0.05), (-2.0, 0.001)]


def closed_form(moves, gain_um_per_V=1.0):
    found, at = [], 0.0
    for voltage, step_s in moves:
        at += -math.expm1(-step_s / TAU_S) * (gain_um_per_V * voltage - at)
        found.append(at)
    return found


def run(plant, moves):
    plant.reset()
    return [plant.step(voltage, step_s) for voltage, step_s in moves]


@pytest.mark.parametrize("state", [True, False])
def test_runs_and_runs_again(tmp_path: Path, state: bool):
    with FmuPlant(foreign_fmu(tmp_path / "lag.fmu", state=state)) as plant:
        assert (plant.input.name, plant.output.name) == ("drive.u", "sensor.y")
        first = run(plant, MOVES)
        assert first == pytest.approx(closed_form(MOVES), rel=1e-12)
        assert run(plant, MOVES) == first
        plant.set_parameters({"gain": 2e-6})
        assert run(plant, MOVES) == pytest.approx(closed_form(MOVES, 2.0), rel=1e-12)


@pytest.mark.parametrize(
    ("input_unit", "output_unit", "gain"),
    [("V", "m", 1e-6), ("mV", "m", 1e-9), ("V", "mm", 1e-3), ("mV", "tick", 0.04)],
)
def test_units_are_those_that_the_fmu_declares(tmp_path: Path, input_unit: str, output_unit: str, gain: float):
    path = foreign_fmu(tmp_path / "lag.fmu", input_unit=input_unit, output_unit=output_unit, gain=gain)
    with FmuPlant(path) as plant:
        assert run(plant, MOVES) == pytest.approx(closed_form(MOVES), rel=1e-12)


@pytest.mark.parametrize("state", [True, False])
def test_even_steps_are_taken_with_their_rounding_and_uneven_ones_refused(tmp_path: Path, state: bool):
    even = [(1.0, step_s) for step_s in np.diff(np.arange(20) * 0.01).tolist()]
    with FmuPlant(foreign_fmu(tmp_path / "lag.fmu", any_step=False, state=state)) as plant:
        assert run(plant, even) == pytest.approx(closed_form(even), rel=1e-12)
        with pytest.raises(InputError, match=r"equal steps only.*found 0.05 s after 0.02 s"):
            run(plant, MOVES)
        assert run(plant, even) == pytest.approx(closed_form(even), rel=1e-12)


def test_messages_come_with_their_numbers_filled_in(tmp_path: Path):
    with (
        FmuPlant(foreign_fmu(tmp_path / "lag.fmu")) as plant,
        pytest.raises(RunError, match=r"found nan, expected a number below inf"),
    ):
        plant.step(math.nan, 0.01)
    with pytest.raises(InputError, match=r"tau is 0 s, expected more than 0"):
        FmuPlant(tmp_path / "lag.fmu", parameters={"tau": 0.0})


@pytest.mark.slow
@pytest.mark.parametrize(("any_step", "state"), [(True, True), pytest.param(False, False, marks=pytest.mark.slow)])
def test_the_check_finds_no_fault_and_notes_what_it_cannot_do(tmp_path: Path, any_step: bool, state: bool):
    report = check(foreign_fmu(tmp_path / "lag.fmu", any_step=any_step, state=state))
    assert report.faults == ()
    noted = "\n".join(finding.what for finding in report.findings)
    assert ("canGetAndSetFMUstate is false" in noted) is not state
    assert ("canHandleVariableCommunicationStepSize is false" in noted) is not any_step
    assert "trial run" in report.ran


@pytest.mark.slow
def test_beside_a_plant_of_this_project(tmp_path: Path):
    code = """
import sys
from bender_export.build import build_plant_fmu
from bender_loop.fmu.plant import FmuPlant
from bender_plant.model import load_model
from pathlib import Path
own = build_plant_fmu(load_model("beam"), Path(sys.argv[2]))
def run(plant): plant.reset(); return [plant.step(10.0 * (k % 3), 0.01) for k in range(30)]
with FmuPlant(own) as plant: alone = run(plant)
with FmuPlant(sys.argv[1]) as lag: lag_alone = run(lag)
with FmuPlant(own) as plant, FmuPlant(sys.argv[1]) as lag:
    plant.reset(); lag.reset()
    both = [(plant.step(10.0 * (k % 3), 0.01), lag.step(10.0 * (k % 3), 0.01)) for k in range(30)]
print([a for a, _ in both] == alone and [b for _, b in both] == lag_alone and alone != lag_alone)
"""
    words = [sys.executable, "-c", code, str(foreign_fmu(tmp_path / "lag.fmu")), str(tmp_path / "own.fmu")]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60)
    assert done.stdout == "True\n", done.stderr


@pytest.mark.parametrize("capable", few([True, False], 0))
def test_compare_takes_it(tmp_path: Path, capable: bool):
    path = foreign_fmu(tmp_path / "lag.fmu", any_step=capable, state=capable, output_unit="mm", gain=1e-3)
    even = [(voltage, 0.02) for voltage, _ in MOVES * 5]
    rows = zip(even, [0.0, *closed_form(even)[:-1]], strict=True)
    lines = ["time_s,voltage_V,displacement_um", *(f"{0.02 * k!r},{u!r},{y!r}" for k, ((u, _), y) in enumerate(rows))]
    (tmp_path / "record.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    words = ["--fmu", path, "--input", "drive.u", "--output", "sensor.y", "--out", tmp_path / "compared"]
    assert main(["compare", str(tmp_path / "record.csv"), *map(str, words)]) == 0
    compared = json.loads((tmp_path / "compared" / "comparison.json").read_text(encoding="utf-8"))
    assert compared["before"]["rms_um"] < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("capable", few([True, False], 0))
def test_tune_takes_it(tmp_path: Path, capable: bool):
    path = foreign_fmu(tmp_path / "lag.fmu", any_step=capable, state=capable, input_unit="mV", gain=1e-9)
    words = [
        "--fmu",
        path,
        "--evaluations",
        12,
        "--duration",
        0.5,
        "--setpoint",
        5,
        "--exposure",
        0,
        "--out",
        tmp_path / "o",
    ]
    assert main(["tune", *map(str, words)]) == 0
    assert json.loads((tmp_path / "o" / "tuning.json").read_text(encoding="utf-8"))
