"""Derivatives of the translated step against finite differences of the Python plant."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from effect_examples import EXAMPLES
from few import few_rows
from native_hosts import Running, needs_own_compiler, plant_library

from bender_cli.main import main
from bender_native.linearise import linearised
from bender_plant.model import Model, load_model
from bender_plant.plant import Plant
from bender_plant.variables import variables

pytestmark = needs_own_compiler

PAPER = load_model("paper")
STEP_S = 0.002
SMOOTH = [
    (block_id, parameters)
    for block_id, parameters in EXAMPLES
    if block_id not in ("supply_quantisation", "sensor_quantisation", "backlash", "dead_zone")
]


def reading_m(model: Model, voltages: list[float], last_V: float) -> float:
    plant = Plant(model)
    state, time_s, reading_um = plant.initial(), 0.0, 0.0
    for voltage_V in [*voltages, last_V]:
        state, reading_um, _ = plant.step(state, voltage_V, time_s, STEP_S)
        time_s += STEP_S
    return reading_um / 1e6


@pytest.mark.parametrize(
    ("block_id", "parameters"),
    few_rows(SMOOTH, [name for name, _ in SMOOTH].index("creep")),
)
def test_by_the_voltage_of_the_last_step(block_id: str, parameters: dict[str, Any]) -> None:
    model = PAPER.with_block(block_id, **parameters)
    voltages = [3.0, 7.0, 12.0, 12.5, 20.0]
    with Running(plant_library(model)) as running:
        for k, voltage_V in enumerate([*voltages, 23.0]):
            running.step(voltage_V, k * STEP_S, STEP_S)
        (slope,) = running.slopes(["displacement"], "voltage")
    change = 1e-5
    expected = (reading_m(model, voltages, 23.0 + change) - reading_m(model, voltages, 23.0 - change)) / (2.0 * change)
    assert slope == pytest.approx(expected, rel=2e-4, abs=1e-12)


@pytest.mark.slow
def test_by_every_tunable_parameter_before_the_first_step_that_differs() -> None:
    model = PAPER.with_block("creep", gains=(0.2,), time_constants_s=(0.1,)).with_block(
        "sensor_lag", time_constant_s=0.01
    )
    with Running(plant_library(model)) as running:
        running.step(20.0, 0.0, STEP_S)
        for variable in variables(model):
            if variable.variability != "tunable" or variable.name == "bending_modes.cubic":
                continue
            (slope,) = running.slopes(["displacement"], variable.name)
            assert variable.start is not None
            change = 1e-5 * max(abs(variable.start), 0.1)
            above, below = (
                reading_m(model.with_values({variable.name: variable.start + x}), [], 20.0) for x in (change, -change)
            )
            assert slope == pytest.approx((above - below) / (2.0 * change), rel=1e-3, abs=1e-11), variable.name


@pytest.mark.slow
def test_of_the_reading_before_the_first_step() -> None:
    with Running(plant_library(PAPER)) as running:
        assert running.slopes(["displacement", "tip_displacement"], "calibration.offset") == [1e-6, 0.0]
        assert running.slopes(["displacement"], "voltage") == [0.0]


@pytest.mark.slow
def test_the_linear_model_predicts_small_changes() -> None:
    model = load_model("bench")
    linear = linearised(model, 10.0, STEP_S, 20.0)
    assert linear.notes == ()
    plant = Plant(model)
    state, time_s = plant.initial(), 0.0
    for _ in range(200):
        state, _, _ = plant.step(state, 10.0, time_s, 0.1)
        time_s += 0.1
    x, found, expected = np.zeros(len(linear.states)), [], []
    for k in range(50):
        change = 1e-3 * (1.0 if k % 7 < 4 else -0.5)
        state, reading_um, _ = plant.step(state, 10.0 + change, time_s, STEP_S)
        time_s += STEP_S
        x = linear.A @ x + linear.B[:, 0] * change
        found.append(float((linear.C @ x)[0]))
        expected.append(reading_um / 1e6 - linear.displacement_m)
    assert np.max(np.abs(np.array(found) - expected)) < 2e-3 * np.ptp(expected)


@pytest.mark.slow
def test_a_corner_is_said() -> None:
    model = PAPER.with_block("dead_zone", threshold_V=5.0)
    linear = linearised(model, 5.0, STEP_S, 1.0)
    assert any("corner" in note for note in linear.notes)


@pytest.mark.slow
def test_the_command_writes_json_and_npz(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fmu", "linearise", "--voltage", "10", "--out", str(tmp_path / "linear.json")]) == 0
    table = json.loads((tmp_path / "linear.json").read_text(encoding="utf-8"))
    n = len(table["states"])
    assert np.shape(table["A"]) == (n, n)
    assert np.max(np.abs(np.linalg.eigvals(np.array(table["A"])))) < 1.0
    assert main(["fmu", "linearise", "--voltage", "10", "--out", str(tmp_path / "linear.npz")]) == 0
    with np.load(tmp_path / "linear.npz") as arrays:
        assert np.array_equal(arrays["A"], table["A"])
    assert main(["fmu", "linearise", "--out", str(tmp_path / "linear.txt")]) == 2
    assert "expected .json or .npz" in capsys.readouterr().err
