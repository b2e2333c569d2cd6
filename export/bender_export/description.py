"""The model description: what FMI 2.0 asks for and PythonFMU does not write.

PythonFMU's element tree is kept where it is right (library, capabilities, log categories); units, ranges, start values
to the last digit, the model structure with its initial unknowns and the date are put in here.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from bender_export.origin import generation_date
from bender_export.slaves.shell import Row
from bender_export.units import Unit, parse_unit

TOLERANCE = "1e-06"
"""For tools that ask for one; the discretisation is exact and needs none."""
_NOMINAL = {"m": 1e-5, "V": 10.0}


@dataclass(frozen=True, slots=True)
class Description:
    """What a model description says beside PythonFMU's part.

    Attributes:
        guid: identifies the content of the FMU.
        name: of the device.
        text: one sentence on the model.
        table: the variables; a value reference is a place in it.
        stop_time_s: end of the default experiment, which starts at 0.
        step_s: its communication step.
        initial_dependencies: by output, the variables that decide what it shows before the first step.
    """

    guid: str
    name: str
    text: str
    table: Sequence[Row]
    stop_time_s: float
    step_s: float
    initial_dependencies: Mapping[str, Sequence[str]]


def described(raw: bytes, description: Description) -> bytes:
    """Return PythonFMU's modelDescription.xml with the rest filled in."""
    root = ElementTree.fromstring(raw)
    root.attrib |= {"guid": description.guid, "modelName": description.name, **about(description)}
    for name in ("DefaultExperiment", "ModelVariables", "ModelStructure"):
        for element in root.findall(name):
            root.remove(element)
    capabilities = list(root).index(root.find("CoSimulation"))  # pyright: ignore[reportArgumentType]
    root.insert(capabilities + 1, unit_definitions(description.table))
    SubElement(
        root,
        "DefaultExperiment",
        startTime="0.0",
        stopTime=repr(description.stop_time_s),
        stepSize=repr(description.step_s),
        tolerance=TOLERANCE,
    )
    variables = SubElement(root, "ModelVariables")
    for reference, row in enumerate(description.table):
        variables.append(_scalar_variable(reference, row))
    root.append(_model_structure(description))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def about(description: Description) -> dict[str, str]:
    """Return who made the model, when, and what it is, as FMI 2.0 and 3.0 name it."""
    return {
        "description": description.text,
        "author": "The piezo-bender developers",
        "version": version("piezo-bender"),
        "copyright": "Copyright (c) 2026 The piezo-bender developers",
        "license": "MIT",
        "generationDateAndTime": generation_date(),
        "variableNamingConvention": "structured",
    }


def unit_definitions(table: Sequence[Row]) -> Element:
    """Return the units of a table of variables, as FMI 2.0 and 3.0 write them."""
    definitions = Element("UnitDefinitions")
    for name in sorted({row.unit for row in table}):
        definitions.append(unit_element(name))
    return definitions


def unit_element(name: str) -> Element:
    """Return a unit as FMI 2.0 and 3.0 write it."""
    unit = _known(name)
    if unit is None:
        return Element("Unit", name=name)
    element = Element("Unit", name=unit.name)
    base = SubElement(element, "BaseUnit", {key: str(value) for key, value in unit.exponents.items()})
    if unit.factor != 1.0:
        base.set("factor", repr(unit.factor))
    if unit.display is not None:
        shown, factor = unit.display
        SubElement(element, "DisplayUnit", name=shown, factor=repr(factor))
    return element


def _known(name: str) -> Unit | None:
    """Return a unit, None for one of another device that is not known here: it is declared by its name alone."""
    try:
        return parse_unit(name)
    except ValueError:
        return None


def _scalar_variable(reference: int, row: Row) -> Element:
    element = Element(
        "ScalarVariable",
        name=row.name,
        valueReference=str(reference),
        description=row.description,
        causality=row.causality,
        variability=row.variability,
    )
    if row.causality != "input":
        element.set("initial", "exact" if row.causality == "parameter" else "calculated")
    if isinstance(row.start, bool):
        SubElement(element, "Boolean", start=str(row.start).lower())
    else:
        SubElement(element, "Real", real_attributes(row))
    return element


def real_attributes(row: Row) -> dict[str, str]:
    """Return unit, range, nominal and start value of a real variable."""
    attributes = {"unit": row.unit}
    unit = _known(row.unit)
    display = None if unit is None else unit.display
    if display is not None:
        attributes["displayUnit"] = display[0]
    for name, bound in (("min", row.minimum), ("max", row.maximum)):
        if math.isfinite(bound):
            attributes[name] = repr(float(bound))
    nominal = abs(float(row.start)) if row.causality == "parameter" else _NOMINAL.get(row.unit, 0.0)
    if nominal > 0.0:
        attributes["nominal"] = repr(nominal)
    if row.causality != "output":
        attributes["start"] = repr(float(row.start))
    return attributes


def _model_structure(description: Description) -> Element:
    """List the outputs: they move with a step only, so at a communication point they depend on no input."""
    structure = Element("ModelStructure")
    outputs, initial_unknowns = SubElement(structure, "Outputs"), SubElement(structure, "InitialUnknowns")
    places = {row.name: str(index) for index, row in enumerate(description.table, start=1)}
    for row in description.table:
        if row.causality == "output":
            SubElement(outputs, "Unknown", index=places[row.name], dependencies="")
            known = " ".join(places[name] for name in description.initial_dependencies[row.name])
            SubElement(initial_unknowns, "Unknown", index=places[row.name], dependencies=known)
    return structure
