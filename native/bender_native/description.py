"""The model descriptions of FMUs without Python, from the same tables as those of PythonFMU."""

from collections.abc import Sequence
from importlib.metadata import version
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from bender_export.description import TOLERANCE, Description, about, described, real_attributes, unit_definitions
from bender_export.slaves.shell import Row

_TOOL = "piezo-bender"
_TIME = Row("time", "independent", "continuous", "s", 0.0, 0.0, 0.0, "simulation time")


def fmi2_description(name: str, description: Description, sources: Sequence[str], has_slopes: bool = True) -> bytes:
    """Return the modelDescription.xml of FMI 2.0; `sources` are the files that must be compiled."""
    root = Element("fmiModelDescription", fmiVersion="2.0", modelName=description.name, generationTool=_tool())
    simulation = SubElement(
        root,
        "CoSimulation",
        modelIdentifier=name,
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
        providesDirectionalDerivative=_truth(has_slopes),
    )
    files = SubElement(simulation, "SourceFiles")
    for source in sources:
        SubElement(files, "File", name=source)
    categories = SubElement(root, "LogCategories")
    SubElement(categories, "Category", name="logStatusError")
    return described(ElementTree.tostring(root), description)


def fmi3_description(name: str, description: Description, has_slopes: bool = True) -> bytes:
    """Return the modelDescription.xml of FMI 3.0; the time is the variable behind those of the table."""
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "3.0",
            "modelName": description.name,
            "instantiationToken": description.guid,
            "generationTool": _tool(),
        }
        | about(description),
    )
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=name,
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        providesDirectionalDerivatives=_truth(has_slopes),
        canHandleVariableCommunicationStepSize="true",
    )
    root.append(unit_definitions((*description.table, _TIME)))
    SubElement(SubElement(root, "LogCategories"), "Category", name="logStatusError")
    SubElement(
        root,
        "DefaultExperiment",
        startTime="0.0",
        stopTime=repr(description.stop_time_s),
        tolerance=TOLERANCE,
        stepSize=repr(description.step_s),
    )
    variables = SubElement(root, "ModelVariables")
    for reference, row in enumerate(description.table):
        variables.append(_variable(reference, row))
    SubElement(
        variables,
        "Float64",
        name=_TIME.name,
        valueReference=str(len(description.table)),
        causality="independent",
        variability="continuous",
        unit=_TIME.unit,
        description=_TIME.description,
    )
    root.append(_structure(description))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def build_description(name: str, sources: Sequence[str]) -> bytes:
    """Return `sources/buildDescription.xml` of FMI 3.0."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=name)
    files = SubElement(configuration, "SourceFileSet", language="C99")
    for source in sources:
        SubElement(files, "SourceFile", name=source)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def _truth(value: bool) -> str:
    return str(value).lower()


def _tool() -> str:
    return f"{_TOOL} {version('piezo-bender')}"


def _variable(reference: int, row: Row) -> Element:
    attributes = {
        "name": row.name,
        "valueReference": str(reference),
        "description": row.description,
        "causality": row.causality,
        "variability": row.variability,
    }
    if row.causality != "input":
        attributes["initial"] = "exact" if row.causality == "parameter" else "calculated"
    if isinstance(row.start, bool):
        return Element("Boolean", attributes | {"start": _truth(row.start)})
    return Element("Float64", attributes | real_attributes(row))


def _structure(description: Description) -> Element:
    """List the outputs: they move with a step only, so at a communication point they depend on no input."""
    structure = Element("ModelStructure")
    references = {row.name: str(k) for k, row in enumerate(description.table)}
    outputs = [row.name for row in description.table if row.causality == "output"]
    for name in outputs:
        SubElement(structure, "Output", valueReference=references[name], dependencies="")
    for name in outputs:
        known = " ".join(references[x] for x in description.initial_dependencies[name])
        SubElement(structure, "InitialUnknown", valueReference=references[name], dependencies=known)
    return structure
