"""Model descriptions: the rules that checkers know, units, and that what is promised is what the FMU does."""

import io
import math
import struct
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import pytest
from effect_examples import EXAMPLES
from fmpy.fmi1 import FMICallException
from hypothesis import given
from hypothesis import strategies as st

from bender_export.assembly import plant_parts
from bender_export.build import plant_fmu
from bender_export.units import parse_unit
from bender_plant.blocks import BLOCKS
from bender_plant.model import Model, load_model
from bender_plant.plant import Plant

FMUS = pytest.mark.parametrize("fmu", ["plant_fmu", "beam_fmu", "controller_fmu"])


def description_of(path: Path) -> bytes:
    with zipfile.ZipFile(path) as archive:
        return archive.read("modelDescription.xml")


@FMUS
def test_description_keeps_the_rules_that_checkers_know(fmu: str, request: pytest.FixtureRequest) -> None:
    root = ElementTree.fromstring(description_of(request.getfixturevalue(fmu)))
    assert root.attrib["generationDateAndTime"].endswith("Z")
    capabilities = root.find("CoSimulation")
    assert capabilities is not None
    assert capabilities.attrib["needsExecutionTool"] == "false"
    for name in ("canHandleVariableCommunicationStepSize", "canGetAndSetFMUstate", "canSerializeFMUstate"):
        assert capabilities.attrib[name] == "true"
    outputs = {
        str(index)
        for index, variable in enumerate(root.iter("ScalarVariable"), start=1)
        if variable.attrib["causality"] == "output"
    }
    for group in ("Outputs", "InitialUnknowns"):
        assert {unknown.attrib["index"] for unknown in root.iterfind(f"ModelStructure/{group}/Unknown")} == outputs


def test_every_number_of_the_model_is_a_parameter_to_the_last_bit(plant_fmu: Path) -> None:
    model = load_model("paper").with_values({"bending_modes.damping_ratio": 0.1 + 0.2})
    root = ElementTree.fromstring(description_of(plant_fmu))
    starts = {
        variable.attrib["name"]: float(variable[0].attrib["start"])
        for variable in root.iter("ScalarVariable")
        if variable.attrib["causality"] == "parameter"
    }
    assert starts == load_model("paper").values()
    assert starts.keys() == model.values().keys()


def test_signals_have_si_units_and_lengths_show_in_micrometres(plant_fmu: Path) -> None:
    signals = {v.name: v for v in fmpy.read_model_description(str(plant_fmu)).modelVariables[:3]}
    assert {name: v.unit for name, v in signals.items()} == {
        "voltage": "V",
        "displacement": "m",
        "tip_displacement": "m",
    }
    assert signals["displacement"].displayUnit == "um"


@pytest.mark.parametrize(
    ("name", "factor", "exponents"),
    [
        ("1", 1.0, {}),
        ("V", 1.0, {"kg": 1, "m": 2, "s": -3, "A": -1}),
        ("um/(V.s)", 1e-6, {"kg": -1, "m": -1, "s": 2, "A": 1}),
        ("1/(um.s)", 1e6, {"m": -1, "s": -1}),
        ("kg/m3", 1.0, {"kg": 1, "m": -3}),
        ("C/N", 1.0, {"A": 1, "s": 3, "kg": -1, "m": -1}),
        ("V.s/um", 1e6, {"kg": 1, "m": 1, "s": -2, "A": -1}),
        ("Hz", 1.0, {"s": -1}),
    ],
)
def test_units_by_hand(name: str, factor: float, exponents: dict[str, int]) -> None:
    unit = parse_unit(name)
    assert unit.factor == factor
    assert unit.exponents == exponents


@given(st.lists(st.sampled_from(["m", "um", "s", "V", "kg3", "Pa", "Ohm"]), min_size=1, max_size=3))
def test_a_unit_over_itself_is_dimensionless(parts: list[str]) -> None:
    product = ".".join(parts)
    unit = parse_unit(f"{product}/({product})")
    assert unit.exponents == {}
    assert math.isclose(unit.factor, 1.0)


def test_an_unknown_unit_is_named() -> None:
    with pytest.raises(ValueError, match=r"unit 'V/furlong': found 'furlong', expected one of"):
        parse_unit("V/furlong")


@pytest.mark.parametrize(("longest_s", "stop_s"), [(0.0, 1.0), (0.02, 1.0), (20.0, 100.0), (30.0, 200.0)])
def test_a_default_experiment_lasts_as_long_as_the_plant_remembers(longest_s: float, stop_s: float) -> None:
    creep = {"gains": (0.1, 0.1), "time_constants_s": (0.1 * longest_s, longest_s)}
    model = load_model("paper").with_block("creep", **creep) if longest_s else load_model("paper")
    assert plant_parts(model, "{0}")[0].stop_time_s == stop_s


STEPS = [(15.0, 0.01), (4.0, 0.02), (22.0, 0.015)]
ROOT = Path(__file__).parents[2]


HIDING = (
    "supply_quantisation", "sensor_quantisation", "dead_zone", "asymmetric_dead_zone", "stiffening", "backlash",
    "coulomb_friction",
)  # fmt: skip


def full_model() -> Model:
    """The paper's model with every effect that can stand beside it, at values where it acts.

    What rounds, sticks or has a dead zone would hide small changes of the others.
    """
    model = load_model("paper")
    for block_id, parameters in EXAMPLES:
        if block_id not in HIDING:
            model = model.with_block(block_id, **parameters)
    return model.with_values({"transport_delay.delay": 0.004, "slew_limit.slew_rate": 2e4})


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory, running_fmu: Any) -> Iterator[Any]:
    path = tmp_path_factory.mktemp("full") / "full.fmu"
    path.write_bytes(plant_fmu(full_model()))
    with running_fmu(path) as running:
        running.description = fmpy.read_model_description(str(path))
        yield running


def parameters_of(running: Any) -> list[Any]:
    return [variable for variable in running.description.modelVariables if variable.causality == "parameter"]


def other_value(variable: Any) -> float:
    """A value beside the start value and within the bounds."""
    start, low, high = (float(x) for x in (variable.start, variable.min or -math.inf, variable.max or math.inf))
    near = start * 1.02 if start else 0.02
    return near if low <= near <= high else start * 0.98


@pytest.mark.slow
def test_tunable_parameters_tune_and_fixed_ones_stay(full: Any) -> None:
    acted: dict[str, bool] = {}
    for variable in parameters_of(full):
        full.slave.reset()
        full.begin({})
        state, time_s = Plant(full_model()).initial(), 0.0
        before = Plant(full_model())
        voltage_V, step_s = STEPS[0]
        state, _, _ = before.step(state, voltage_V, time_s, step_s)
        full.step(step_s, voltage=voltage_V)
        value = other_value(variable)
        if variable.variability == "fixed":
            with pytest.raises(FMICallException):
                full.set({variable.name: value})
            assert full.get(variable.name) == [float(variable.start)]
            continue
        full.set({variable.name: value})
        changed = Plant(full_model().with_values({variable.name: value}))
        time_s, untouched, differs = step_s, state, False
        for voltage_V, step_s in STEPS[1:]:
            untouched, unchanged_um, _ = before.step(untouched, voltage_V, time_s, step_s)
            state, displacement_um, _ = changed.step(state, voltage_V, time_s, step_s)
            assert full.step(step_s, voltage=voltage_V)[0] == pytest.approx(1e-6 * displacement_um, abs=1e-12)
            differs = differs or displacement_um != unchanged_um
            time_s += step_s
        acted[variable.name] = differs
    # parameters of forms that are not in force do nothing, nor does a damping ratio that another block replaces, nor a
    # gain of negative commands where none is given
    with_forms = {settings.id for settings in full_model().blocks if hasattr(settings.parameters, "form")}
    inert = {name for name, differs in acted.items() if not differs} - {
        "bending_modes.damping_ratio",
        "asymmetric_gain.difference",
    }
    assert {name for name in inert if name.partition(".")[0] not in with_forms} == set()
    assert len(inert) < 0.2 * len(acted)


@pytest.mark.slow
def test_fixed_parameters_act_when_they_are_set_before_the_start(full: Any) -> None:
    fixed = [variable for variable in parameters_of(full) if variable.variability == "fixed"]
    assert fixed
    for variable in fixed:
        full.slave.reset()
        full.begin({variable.name: other_value(variable)})
        plant = Plant(full_model().with_values({variable.name: other_value(variable)}))
        _, displacement_um, _ = plant.step(plant.initial(), 15.0, 0.0, 0.01)
        assert full.step(0.01, voltage=15.0)[0] == pytest.approx(1e-6 * displacement_um, abs=1e-12)


def test_before_the_start_outputs_depend_on_what_is_listed_and_on_nothing_else(full: Any) -> None:
    listed = {
        unknown.variable.name: {known.name for known in unknown.dependencies}
        for unknown in full.description.initialUnknowns
    }
    assert listed["tip_displacement"] == set()
    full.slave.reset()
    full.begin({}, 0.3)
    resting = full.get("displacement", "tip_displacement")
    moved: dict[str, set[str]] = {"displacement": set(), "tip_displacement": set()}
    for name in [variable.name for variable in parameters_of(full)] + ["voltage"]:
        value = 10.0 if name == "voltage" else other_value(full.variables[name])
        full.slave.reset()
        full.begin({name: value}, 0.3)
        for output, found, rest in zip(moved, full.get(*moved), resting, strict=True):
            if found != rest:
                moved[output].add(name)
    assert moved["displacement"] <= listed["displacement"]
    assert moved["tip_displacement"] == set()
    assert "calibration.offset" in moved["displacement"]


def test_inputs_move_no_output_without_a_step(full: Any) -> None:
    full.slave.reset()
    full.begin({})
    before = full.step(0.01, voltage=5.0)
    full.set({"voltage": 30.0})
    assert full.get(*full.outputs) == before
    for unknown in full.description.outputs:
        assert unknown.dependencies == []


def test_messages_have_a_category_that_is_declared(plant_fmu: Path, running_fmu: Any) -> None:
    with zipfile.ZipFile(plant_fmu) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    declared = {category.attrib["name"] for category in root.iter("Category")}
    with running_fmu(plant_fmu) as running:
        with pytest.raises(FMICallException):
            running.set({"voltage": math.nan})
        # PythonFMU's library reports what a slave raises without a category
        assert set(running.categories) <= declared | {""}
        assert running.categories


@pytest.mark.parametrize("fmu", ["plant_fmu", "beam_fmu", "controller_fmu"])
def test_page_icon_and_licences_go_along(fmu: str, request: pytest.FixtureRequest) -> None:
    with zipfile.ZipFile(request.getfixturevalue(fmu)) as archive:
        page = archive.read("documentation/index.html").decode()
        icon = archive.read("model.png")
        assert archive.read("documentation/licenses/license.txt") == (ROOT / "LICENSE").read_bytes()
        assert b"MIT" in archive.read("documentation/licenses/pythonfmu.txt")
        root = ElementTree.parse(io.BytesIO(archive.read("modelDescription.xml"))).getroot()
    assert icon.startswith(b"\x89PNG")
    assert struct.unpack(">II", icon[16:24]) == (200, 200)
    assert root.attrib["guid"] in page
    for variable in root.iter("ScalarVariable"):
        assert f"<td>{variable.attrib['name']}</td>" in page
    names_of_blocks = {variable.attrib["name"].partition(".")[0] for variable in root.iter("ScalarVariable")}
    for block_id in names_of_blocks & set(BLOCKS):
        assert f"block {block_id}" in page
    if fmu == "plant_fmu":
        assert "w&#39; = -0.48 w + 1.652 u + 0.818 u&#39;" in page


def test_parameters_have_unit_bounds_start_meaning_and_size(plant_fmu: Path) -> None:
    with zipfile.ZipFile(plant_fmu) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    for variable in root.iter("ScalarVariable"):
        says = {name: float(text) for name, text in variable[0].attrib.items() if name not in ("unit", "displayUnit")}
        assert variable[0].attrib["unit"]
        assert variable.attrib["description"]
        if variable.attrib["causality"] == "parameter":
            assert says["min"] <= says["start"] <= says["max"]
            assert "." in variable.attrib["name"]
            assert says.get("nominal", 0.0) == abs(says["start"])
        else:
            assert says["nominal"] > 0.0
