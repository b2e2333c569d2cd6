"""The closed loop as an SSP archive (System Structure and Parameterization 1.0): reference, controller, plant.

Every input is connected, since importers disagree on what an unconnected one holds; the setpoint therefore comes from
a component. Each set of values stands inline at its component, where the small importers look, and as a file of the
whole system under `resources/`; the second variant of the system, `Staircase.ssd`, differs in its values only.
"""

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from bender_export.archive import packed
from bender_export.slaves.controller import TABLE as CONTROLLER
from bender_export.slaves.reference import TABLE as REFERENCE
from bender_loop.control.pid import Gains, Limits

STOP_S = 1.0
PID_FILE = "PidController.fmu"
_SPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}
_COMPONENTS = {
    "reference": ("StaircaseReference.fmu", (("setpoint", "output", "m"),)),
    "controller": (
        PID_FILE,
        (("setpoint", "input", "m"), ("measurement", "input", "m"), ("command", "output", "V")),
    ),
    "plant": (
        "PiezoBender.fmu",
        (("voltage", "input", "V"), ("displacement", "output", "m"), ("tip_displacement", "output", "m")),
    ),
}
_BASE_UNITS = {"V": {"kg": "1", "m": "2", "s": "-3", "A": "-1"}, "m": {"m": "1"}}

ParameterSet = Mapping[str, Mapping[str, float]]
_GAINS = {row.name: row.start for row in CONTROLLER if row.causality == "parameter"}
_STEP = {row.name: row.start for row in REFERENCE if row.causality == "parameter"}
PARAMETER_SETS: Mapping[str, ParameterSet] = {
    "step": {"reference": _STEP, "controller": _GAINS},
    "staircase": {
        "reference": _STEP | {"staircase.rise": 4e-6, "staircase.final": 1.6e-5, "staircase.dwell": 0.2},
        "controller": _GAINS,
    },
}


@dataclass(frozen=True, slots=True)
class Loop:
    """How the loop is run.

    Attributes:
        parameter_set: the values of the main variant, a name in `PARAMETER_SETS`.
        step_s: of the master, and so the sampling time of the controller.
        controller: values of parameters of the controller beside the start values of the PID block.
        controller_file: name of the controller's FMU, one with the ports and parameters of the PID block at least.
        measured: output of the plant that the controller gets.
    """

    parameter_set: str = "step"
    step_s: float = 0.01
    controller: Mapping[str, float] = field(default_factory=dict)
    controller_file: str = PID_FILE
    measured: str = "displacement"

    def values(self, parameter_set: str) -> ParameterSet:
        """Return the values by component of one of the parameter sets."""
        own = PARAMETER_SETS[parameter_set]
        return {**own, "controller": {**own["controller"], **self.controller}}


def loop_of(gains: Gains, limits: Limits, step_s: float) -> Loop:
    """Return the loop under tuned gains, sampled as they were tuned for."""
    found = (*astuple(gains), *astuple(limits))
    return Loop(step_s=step_s, controller=dict(zip(_GAINS, found, strict=True)))


def closed_loop_archive(plant: bytes, controller: bytes, reference: bytes, loop: Loop) -> bytes:
    """Return the archive of the closed loop of three FMUs."""
    entries = dict(zip(("plant", "controller", "reference"), (plant, controller, reference), strict=True))
    archive = {f"resources/{_source(name, loop)}": data for name, data in entries.items()}
    archive["SystemStructure.ssd"] = _structure(loop.parameter_set, loop)
    archive["Staircase.ssd"] = _structure("staircase", loop)
    for name in PARAMETER_SETS:
        archive[f"resources/{name}.ssv"] = parameter_file(name, loop.values(name))
    return packed(archive)


def one_component(
    name: str, fmu: bytes, ports: Sequence[tuple[str, str]], parameters: Mapping[str, float], step_s: float
) -> bytes:
    """Return the archive of a system that is one FMU, with its parameters as `resources/corrected.ssv`.

    Args:
        name: of the system and its FMU.
        fmu: its content.
        ports: names of its variables and their kinds, `input` or `output`; small importers know no ports of a system.
        parameters: of the FMU, by name.
        step_s: of the master.
    """
    root = _root("ssd:SystemStructureDescription", ("ssd", "ssc", "ssv", "oms"), name)
    system = SubElement(root, "ssd:System", name=name)
    component = Element(
        "ssd:Component", name="corrected", type="application/x-fmu-sharedlibrary", source=f"resources/{name}.fmu"
    )
    inner = SubElement(component, "ssd:Connectors")
    for port, kind in ports:
        SubElement(SubElement(inner, "ssd:Connector", name=port, kind=kind), "ssc:Real")
    if parameters:
        bindings = SubElement(component, "ssd:ParameterBindings")
        inline = SubElement(SubElement(bindings, "ssd:ParameterBinding"), "ssd:ParameterValues")
        inline.append(_parameters(Element("ssv:ParameterSet", version="1.0", name="corrected"), parameters))
    SubElement(system, "ssd:Elements").append(component)
    system.append(_master(step_s))
    SubElement(root, "ssd:DefaultExperiment", startTime="0.0", stopTime=repr(STOP_S))
    values = parameter_file("corrected", {"": parameters})
    return packed({f"resources/{name}.fmu": fmu, "SystemStructure.ssd": _text(root), "resources/corrected.ssv": values})


def _structure(parameter_set: str, loop: Loop) -> bytes:
    root = _root("ssd:SystemStructureDescription", ("ssd", "ssc", "ssv", "oms"), "ClosedLoop")
    system = SubElement(
        root, "ssd:System", name="ClosedLoop", description="plant, PID controller and setpoint in a closed loop"
    )
    elements = SubElement(system, "ssd:Elements")
    for name in _COMPONENTS:
        elements.append(_component(name, parameter_set, loop))
    connections = SubElement(system, "ssd:Connections")
    for start_element, start, end_element, end in _connections(loop):
        SubElement(
            connections,
            "ssd:Connection",
            startElement=start_element,
            startConnector=start,
            endElement=end_element,
            endConnector=end,
        )
    system.append(_master(loop.step_s))
    units = SubElement(root, "ssd:Units")
    for name, exponents in _BASE_UNITS.items():
        SubElement(SubElement(units, "ssc:Unit", name=name), "ssc:BaseUnit", exponents)
    SubElement(root, "ssd:DefaultExperiment", startTime="0.0", stopTime=repr(STOP_S))
    return _text(root)


def _connections(loop: Loop) -> tuple[tuple[str, str, str, str], ...]:
    return (
        ("reference", "setpoint", "controller", "setpoint"),
        ("plant", loop.measured, "controller", "measurement"),
        ("controller", "command", "plant", "voltage"),
    )


def _source(name: str, loop: Loop) -> str:
    return loop.controller_file if name == "controller" else _COMPONENTS[name][0]


def _component(name: str, parameter_set: str, loop: Loop) -> Element:
    source, connectors = _source(name, loop), _COMPONENTS[name][1]
    component = Element(
        "ssd:Component", name=name, type="application/x-fmu-sharedlibrary", source=f"resources/{source}"
    )
    listed = SubElement(component, "ssd:Connectors")
    for connector, kind, unit in connectors:
        SubElement(SubElement(listed, "ssd:Connector", name=connector, kind=kind), "ssc:Real", unit=unit)
    values = loop.values(parameter_set).get(name)
    if values is not None:
        bindings = SubElement(component, "ssd:ParameterBindings")
        inline = SubElement(SubElement(bindings, "ssd:ParameterBinding"), "ssd:ParameterValues")
        inline.append(_parameters(Element("ssv:ParameterSet", version="1.0", name=parameter_set), values))
    return component


def _master(step_s: float) -> Element:
    """Say which master OMSimulator shall take; it refuses a system that does not."""
    annotations = Element("ssd:Annotations")
    annotation = SubElement(annotations, "ssc:Annotation", type="org.openmodelica")
    information = SubElement(SubElement(annotation, "oms:Annotations"), "oms:SimulationInformation")
    SubElement(
        information,
        "oms:FixedStepMaster",
        description="oms-ma",
        stepSize=repr(step_s),
        absoluteTolerance="1e-4",
        relativeTolerance="1e-4",
    )
    return annotations


def parameter_file(name: str, values: ParameterSet) -> bytes:
    """Return a set of values as a file (SSV): by component, whose name is left out where it is empty."""
    root = _root("ssv:ParameterSet", ("ssv", "ssc"), name)
    flat = {f"{part}.{key}" if part else key: value for part, own in values.items() for key, value in own.items()}
    return _text(_parameters(root, flat))


def _parameters(parameter_set: Element, values: Mapping[str, float]) -> Element:
    listed = SubElement(parameter_set, "ssv:Parameters")
    for name, value in values.items():
        parameter = SubElement(listed, "ssv:Parameter", name=name)
        if isinstance(value, bool):
            SubElement(parameter, "ssv:Boolean", value=str(value).lower())
        else:
            SubElement(parameter, "ssv:Real", value=repr(float(value)))
    return parameter_set


def _root(tag: str, spaces: tuple[str, ...], name: str) -> Element:
    names = {f"xmlns:{space}": _SPACES[space] for space in spaces}
    return Element(tag, {**names, "version": "1.0", "name": name})


def _text(root: Element) -> bytes:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
