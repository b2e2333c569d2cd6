"""Anybody's FMU between stages of ours, as one FMU: the same numbers in every importer, the original untouched."""

import hashlib
import zipfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from few import few_rows
from fmu_hosts import IMPORTERS, hosted, largest_difference
from foreign_fmus import arm_fmu, foreign_fmu, needs_compiler
from native_hosts import own_way

from bender_discrepancy.foreign.container_stages import Original
from bender_export.archive import unpacked
from bender_export.slaves.stage import StagesBefore, StagesBehind
from bender_loop.fmu.check.check import check
from bender_loop.fmu.file import read_description
from bender_loop.fmu.plant import FmuPlant
from bender_loop.tables.quantities import of_input_and_output
from bender_native.build import native_stage_fmu
from bender_native.compilers import own_platform
from bender_native.container import Corrected, container_fmu, corrected_system, parameter_values, parameters_of
from bender_plant.blocks import BLOCKS
from bender_plant.model import BlockSettings, Model
from bender_plant.plant import Plant

pytest.importorskip("fmu_manipulation_toolbox", reason="the container library is not installed")
pytestmark = [needs_compiler, pytest.mark.skipif(own_platform() is None, reason="no name for this platform")]
STEP_S, ROW_S, REST_um = 0.0025, 0.02, 3.0
RNG = np.random.default_rng(11)
VOLTS = [float(x) for x in np.repeat(RNG.uniform(-10.0, 40.0, 30), 4)]


def model(name: str, *blocks: tuple[str, Mapping[str, object]]) -> Model:
    return Model(name, None, tuple(BlockSettings(x, BLOCKS[x].parameters(**values)) for x, values in blocks))


BEFORE = model(
    "before",
    ("linear_transduction", {"sensitivity_um_per_V": 0.8}),
    ("transport_delay", {"delay_s": 0.0137}),
    ("slew_limit", {"slew_rate_V_per_s": 700.0}),
    ("dead_zone", {"threshold_V": 1.5}),
    ("rate_independent_hysteresis", {"thresholds_V": (2.0, 6.0), "weights_um_per_V": (0.05, 0.04)}),
    ("calibration", {"gain": 1.25}),
)
BEHIND = model(
    "behind",
    ("linear_transduction", {"sensitivity_um_per_V": 1.0}),
    ("creep", {"gains": (0.05,), "time_constants_s": (1.0,)}),
    ("backlash", {"half_width_um": 0.2}),
    ("sensor_lag", {"time_constant_s": 0.03}),
    ("periodic_disturbance", {"sine_um": 0.3, "frequency_Hz": 7.0}),
    ("calibration", {"gain": 1.1, "offset_um": -0.4}),
)
LAG = (("linear_transduction", {"sensitivity_um_per_V": 2.0}), ("plant_lag", {"time_constant_s": 0.07}))
INSIDE = (
    model("inside", *LAG, ("second_mode", {"share": 0.2, "frequency_Hz": 9.0, "damping_ratio": 0.1})),
    model("without", *LAG),
)


@pytest.fixture(scope="module")
def corrected(tmp_path_factory: pytest.TempPathFactory) -> Corrected:
    path = foreign_fmu(tmp_path_factory.mktemp("original") / "lag.fmu", output_unit="mm", gain=2e-3)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("documentation/licenses/license.txt", "All rights reserved by its maker")
    with FmuPlant(path) as plant:
        ports = plant.input, plant.output
    return Corrected(path, *ports, BEFORE, BEHIND, 1e-3 * REST_um, STEP_S, {"tau": 0.07}, inside=INSIDE)


@pytest.fixture(scope="module")
def fmu(corrected: Corrected, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("container") / "Corrected.fmu"
    made.write_bytes(container_fmu(corrected, own_way(2)))
    return made


@pytest.fixture(scope="module")
def expected_mm(corrected: Corrected) -> list[float]:
    """What the kernels in Python predict around the original in FMPy."""
    before, behind = Plant(BEFORE), Plant(BEHIND)
    beside = [Plant(x) for x in INSIDE]
    states = [x.initial() for x in beside]
    first, second, parts = before.initial(), behind.initial(), round(ROW_S / STEP_S)
    found: list[float] = []
    with FmuPlant(corrected.original, parameters=corrected.start_values) as plant:
        shown_um = 0.0
        for k in range(parts * len(VOLTS)):
            at_s = k * STEP_S
            first, _, _, mean_V = before.held(first, VOLTS[k // parts], at_s, STEP_S)
            inside_um = plant.step(mean_V, STEP_S) - REST_um
            for place, (sign, of_plant) in enumerate(zip((1.0, -1.0), beside, strict=True)):
                states[place], more_um, _ = of_plant.step(states[place], mean_V, at_s, STEP_S)
                inside_um += sign * more_um
            second, shown_um, _ = behind.along(second, inside_um, at_s, STEP_S)
            if k % parts == parts - 1:
                found.append(1e-3 * (shown_um + REST_um))
    return found


def test_units_that_the_original_does_not_declare_are_those_that_it_is_taken_in(
    corrected: Corrected, tmp_path: Path
) -> None:
    path = foreign_fmu(tmp_path / "bare.fmu", input_unit="", output_unit="")
    with FmuPlant(path, quantities=of_input_and_output("W,K")) as plant:
        original = Original(path, plant.input, plant.output, {}, 0.0, of_input_and_output("W,K"))
    assert list(original.taken_units.values()) == ["W", "K"]
    bare = replace(corrected, original=path, input=original.input, output=original.output, start_values={})
    made = tmp_path / "Corrected.fmu"
    made.write_bytes(container_fmu(replace(bare, units=original.taken_units), own_way(2)))
    with FmuPlant(made, quantities=of_input_and_output("W,K")) as plant:
        assert (plant.input.unit, plant.output.unit) == ("W", "K")
    units: dict[str, Any] = {x.name: x.baseUnit for x in read_description(made).unitDefinitions}
    assert (units["W"].kg, units["K"].K) == (1, 1)


def test_it_equals_the_prediction_in_fmpy(fmu: Path, expected_mm: list[float]) -> None:
    with FmuPlant(fmu) as plant:
        assert (plant.input.name, plant.input.unit) == ("drive.u", "V")
        assert (plant.output.name, plant.output.unit) == ("sensor.y", "mm")
        found = [1e-3 * plant.step(volts, ROW_S) for volts in VOLTS]
    assert largest_difference(found, expected_mm) < 1e-9 * np.ptp(expected_mm)
    assert np.ptp(expected_mm) > 0.02


@pytest.mark.slow
@pytest.mark.parametrize("script", IMPORTERS[:2])
def test_it_equals_the_prediction_in_other_importers(
    script: str, fmu: Path, expected_mm: list[float], tmp_path: Path
) -> None:
    with FmuPlant(fmu) as plant:
        references = [plant.input.reference, plant.output.reference]
    job = {
        "fmu": str(fmu), "voltages": VOLTS, "step_s": ROW_S, "ports": ["drive.u", "sensor.y"], "references": references,
    }  # fmt: skip
    assert largest_difference(hosted(script, job, tmp_path), expected_mm) < 1e-9 * np.ptp(expected_mm)


@pytest.mark.slow
def test_no_checker_objects(fmu: Path) -> None:
    assert [x for x in check(fmu).findings if x.severity != "note"] == []


def test_the_original_stands_in_it_byte_for_byte(corrected: Corrected, fmu: Path) -> None:
    def digests(entries: dict[str, bytes]) -> dict[str, str]:
        return {name: hashlib.sha256(data).hexdigest() for name, data in entries.items()}

    inside = {x.removeprefix("resources/01/"): y for x, y in unpacked(fmu).items() if x.startswith("resources/01/")}
    assert digests(inside) == digests(unpacked(corrected.original))
    assert "documentation/licenses/license.txt" in inside
    assert b"Redistribution" in unpacked(fmu)["documentation/licenses/container.txt"]


def test_its_parameters_are_those_of_the_correction(corrected: Corrected, fmu: Path) -> None:
    values = parameters_of(fmu.read_bytes())
    assert values["before.transport_delay.delay"] == 0.0137
    assert values["behind.calibration.gain"] == 1.1
    assert values == parameter_values(corrected)
    assert (values["inside.sign"], values["without.sign"]) == (1.0, -1.0)
    with FmuPlant(fmu, parameters={"behind.sensor_lag.time_constant": 0.7}) as slow, FmuPlant(fmu) as plain:
        assert abs(slow.step(30.0, 0.2) - REST_um) < 0.5 * abs(plain.step(30.0, 0.2) - REST_um)
    system = corrected_system(fmu.read_bytes(), corrected, values)
    (fmu.parent / "it.ssp").write_bytes(system)
    inside = unpacked(fmu.parent / "it.ssp")
    assert set(inside) == {"SystemStructure.ssd", "resources/Corrected.fmu", "resources/corrected.ssv"}
    assert b"behind.calibration.gain" in inside["resources/corrected.ssv"]


def test_a_system_has_a_port_for_every_input_and_output(corrected: Corrected, tmp_path: Path) -> None:
    """A further input that has none can be connected by nobody."""
    (tmp_path / "it.ssp").write_bytes(corrected_system(arm_fmu(tmp_path / "arm.fmu").read_bytes(), corrected, {}))
    structure = unpacked(tmp_path / "it.ssp")["SystemStructure.ssd"].decode()
    for name, kind in (("command", "input"), ("load", "input"), ("tip", "output"), ("force", "output")):
        assert f'<ssd:Connector name="{name}" kind="{kind}">' in structure


@pytest.mark.slow
def test_the_same_parts_give_the_same_bytes(corrected: Corrected, fmu: Path) -> None:
    assert container_fmu(corrected, own_way(2)) == fmu.read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "stages"), few_rows([(StagesBefore, BEFORE), (StagesBehind, BEHIND)], 0))
def test_stages_by_themselves_equal_the_kernel(
    kind: type[StagesBefore] | type[StagesBehind], stages: Model, tmp_path: Path
) -> None:
    path = tmp_path / "stages.fmu"
    path.write_bytes(native_stage_fmu(kind, stages, own_way(2), scale=2.0, rest=0.25, own=True))
    kernel = Plant(stages)
    state, at_s = kernel.initial(), 0.0
    with FmuPlant(path) as plant:
        for volts, step_s in zip(VOLTS, np.tile([0.01, 0.003, 0.07], len(VOLTS)).tolist(), strict=False):
            value = 2.0 * (volts - 0.25)
            if kind is StagesBefore:
                state, _, _, shown = kernel.held(state, value, at_s, step_s)
            else:
                state, shown, _ = kernel.along(state, value, at_s, step_s)
            at_s += step_s
            assert 1e-6 * plant.step(volts, step_s) == pytest.approx(0.25 + shown / 2.0, rel=1e-12, abs=1e-12)
