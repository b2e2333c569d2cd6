"""The same scenarios through every importer at hand, each in a process of its own, against FMPy."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from few import few
from fmu_hosts import IMPORTERS, WITHIN_M, hosted, largest_difference

from bender_plant.model import load_model
from bender_plant.plant import Plant

STEP_S = 0.01
SCENARIOS = {"step": [10.0] * 120, "staircase": [10.0 * (k // 20 % 6) for k in range(240)]}
UNEVEN = [(20.0 * (k % 3), 0.003 + 0.0071 * (k * k % 11)) for k in range(80)]

InChild = Callable[[Sequence[Path], Sequence[tuple[float, float]]], list[list[list[float]]]]


@pytest.mark.parametrize("script", IMPORTERS)
@pytest.mark.parametrize("scenario", few(SCENARIOS, 0))
def test_every_importer_gives_the_numbers_of_fmpy(
    script: str, scenario: str, plant_fmu: Path, in_child: InChild, tmp_path: Path
) -> None:
    voltages = SCENARIOS[scenario]
    (expected,) = in_child([plant_fmu], [(voltage_V, STEP_S) for voltage_V in voltages])
    found = hosted(script, {"fmu": str(plant_fmu), "voltages": voltages, "step_s": STEP_S}, tmp_path)
    assert largest_difference(found, [outputs[0] for outputs in expected]) <= WITHIN_M
    assert max(found) > 1e-6


def test_a_record_with_uneven_steps_through_fmpy(plant_fmu: Path, in_child: InChild) -> None:
    (found,) = in_child([plant_fmu], UNEVEN)
    plant = Plant(load_model("paper"))
    state, time_s, expected = plant.initial(), 0.0, []
    for voltage_V, step_s in UNEVEN:
        state, displacement_um, _ = plant.step(state, voltage_V, time_s, step_s)
        expected.append(1e-6 * displacement_um)
        time_s += step_s
    assert largest_difference([outputs[0] for outputs in found], expected) <= WITHIN_M
