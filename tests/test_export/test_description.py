import math
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bender_export.assembly import plant_parts
from bender_export.units import parse_unit
from bender_plant.model import load_model

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
