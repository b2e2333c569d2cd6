"""Rules for the model description that neither the schema nor the usual checkers know (FMI 2.0, section 2.2)."""

import math
import re
from collections import Counter
from collections.abc import Iterator
from xml.etree.ElementTree import Element

from bender_loop.fmu.check.findings import Finding, error, note, warning

_DATE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ")
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")
_NAMED = 8
_INTERFACES = ("CoSimulation", "ModelExchange")
_FMI_3_INTERFACES = (*_INTERFACES, "ScheduledExecution")
_FIX_DESCRIPTION = "correct modelDescription.xml, or export the FMU anew with a tool that does"


def model_identifiers(root: Element) -> set[str]:
    """The model identifiers of all interfaces, which name the binaries."""
    found = (root.find(interface) for interface in _FMI_3_INTERFACES)
    return {interface.get("modelIdentifier", "") for interface in found if interface is not None} - {""}


def description_findings(root: Element) -> Iterator[Finding]:
    """Check the model description of an FMI 2.0 FMU."""
    yield from _header(root)
    for interface in _INTERFACES:
        element = root.find(interface)
        if element is not None:
            yield from _capabilities(element)
    yield from _default_experiment(root)
    for variable in root.iterfind("ModelVariables/ScalarVariable"):
        yield from _variable(variable)
    yield from _units(root)
    yield from _structure(root)


def _header(root: Element) -> Iterator[Finding]:
    if not root.get("guid"):
        yield error("the guid is empty", "tools take it to tell one FMU from another", _FIX_DESCRIPTION)
    date = root.get("generationDateAndTime")
    if date is not None and not _DATE.fullmatch(date):
        yield warning(
            f"generationDateAndTime is {date!r}, expected YYYY-MM-DDThh:mm:ssZ",
            "the standard asks for UTC with a Z at the end; strict checkers refuse other forms",
            _FIX_DESCRIPTION,
        )


def _capabilities(interface: Element) -> Iterator[Finding]:
    def says(name: str) -> bool:
        return interface.get(name) in ("true", "1")

    identifier = interface.get("modelIdentifier", "")
    if not _IDENTIFIER.fullmatch(identifier):
        yield error(
            f"the modelIdentifier {identifier!r} is no C identifier",
            "it prefixes the functions of source code FMUs and names the binary",
            _FIX_DESCRIPTION,
        )
    if says("needsExecutionTool"):
        yield warning(
            "needsExecutionTool is true",
            "tools such as PyFMI refuse the FMU, since a second program would have to run it",
            "export it with needsExecutionTool=false if it needs no other tool",
        )
    if says("canSerializeFMUstate") and not says("canGetAndSetFMUstate"):
        yield error(
            "canSerializeFMUstate is true, canGetAndSetFMUstate is not",
            "a state that cannot be had cannot be serialised",
            _FIX_DESCRIPTION,
        )
    if interface.tag == "CoSimulation":
        yield from _limits(says("canHandleVariableCommunicationStepSize"), says("canGetAndSetFMUstate"))


def _limits(any_step: bool, state: bool) -> Iterator[Finding]:
    if not any_step:
        yield note(
            "canHandleVariableCommunicationStepSize is false",
            "the FMU takes equal steps only; a record with uneven steps cannot drive it",
            "bring records onto an even raster",
        )
    if not state:
        yield note(
            "canGetAndSetFMUstate is false",
            "every run resets and initialises the FMU instead of going back to a saved state, which takes longer",
            "nothing, unless a tuning takes too long",
        )


def _default_experiment(root: Element) -> Iterator[Finding]:
    experiment = root.find("DefaultExperiment")
    if experiment is None:
        yield note(
            "DefaultExperiment is missing",
            "tools then guess how long to simulate and how finely",
            "export the FMU with a default experiment",
        )
        return
    start, stop, step = (_number(experiment.get(name)) for name in ("startTime", "stopTime", "stepSize"))
    if stop is not None and not stop > (start or 0.0):
        yield error(
            f"the default experiment ends at {stop!r} s, not after its start", "it has no length", _FIX_DESCRIPTION
        )
    if step is not None and not 0.0 < step < math.inf:
        yield error(f"the default step is {step!r} s", "it must be a finite number > 0", _FIX_DESCRIPTION)


def _variable(variable: Element) -> Iterator[Finding]:
    name = variable.get("name", "?")
    kind = next((element for element in variable if element.tag in _TYPES), None)
    if kind is None:
        return
    for attribute in ("min", "max", "start", "nominal"):
        value = _number(kind.get(attribute)) if kind.tag in ("Real", "Integer") else None
        if value is not None and not math.isfinite(value):
            yield error(f"{name}: {attribute} is {kind.get(attribute)}", "it must be a finite number", _FIX_DESCRIPTION)
            return
    if kind.tag in ("Real", "Integer"):
        yield from _range(name, kind)


def _range(name: str, kind: Element) -> Iterator[Finding]:
    low, high, start, nominal = (_number(kind.get(attribute)) for attribute in ("min", "max", "start", "nominal"))
    if low is not None and high is not None and low > high:
        yield error(f"{name}: min {low:g} lies above max {high:g}", "no value is allowed", _FIX_DESCRIPTION)
    elif start is not None and ((low is not None and start < low) or (high is not None and start > high)):
        bounds = f"{'-inf' if low is None else f'{low:g}'} to {'inf' if high is None else f'{high:g}'}"
        yield error(
            f"{name}: start {start:g} lies outside {bounds}",
            "the FMU starts with a value that it declares impossible; tools refuse or change it",
            _FIX_DESCRIPTION,
        )
    if nominal is not None and not nominal > 0.0:
        yield error(f"{name}: nominal is {nominal:g}", "solvers divide by it; it must be > 0", _FIX_DESCRIPTION)


def _units(root: Element) -> Iterator[Finding]:
    ports = [v for v in root.iterfind("ModelVariables/ScalarVariable") if v.get("causality") in ("input", "output")]
    reals = [(v.get("name", "?"), v.find("Real")) for v in ports]
    bare = [name for name, real in reals if real is not None and not (real.get("unit") or real.get("declaredType"))]
    if bare:
        yield note(
            f"no unit: {', '.join(bare[:_NAMED])}" + (f" and {len(bare) - _NAMED} more" if len(bare) > _NAMED else ""),
            "an input without a unit is taken to be in V here, an output to be in m",
            "export the FMU with units if that is not so",
        )
    for unit in root.iterfind("UnitDefinitions/Unit"):
        if unit.find("BaseUnit") is None:
            yield note(
                f"unit {unit.get('name')!r}: no BaseUnit",
                "tools cannot convert to it or from it, nor find out that two units do not fit",
                "export the FMU with the SI exponents of its units",
            )


def _structure(root: Element) -> Iterator[Finding]:
    variables = root.findall("ModelVariables/ScalarVariable")
    for group in ("Outputs", "Derivatives", "InitialUnknowns"):
        indices = [unknown.get("index", "") for unknown in root.iterfind(f"ModelStructure/{group}/Unknown")]
        for index, count in Counter(indices).items():
            if count > 1:
                yield error(
                    f"ModelStructure/{group} lists index {index} {count} times",
                    "it must be there once",
                    _FIX_DESCRIPTION,
                )
    for unknown in root.iterfind("ModelStructure/Outputs/Unknown"):
        for index in unknown.get("dependencies", "").split():
            place = int(index) - 1 if index.isdigit() else -1
            if 0 <= place < len(variables) and variables[place].get("causality") == "parameter":
                yield warning(
                    f"output {_name_of(variables, unknown)}: depends on the parameter {variables[place].get('name')}",
                    "dependencies of outputs are on inputs and states; tools look for a loop there",
                    _FIX_DESCRIPTION,
                )


def _name_of(variables: list[Element], unknown: Element) -> str:
    """The name of the variable that an Unknown stands for, or its index where that leads nowhere."""
    index = unknown.get("index", "")
    place = int(index) - 1 if index.isdigit() else -1
    return variables[place].get("name", "?") if 0 <= place < len(variables) else index


def _number(text: str | None) -> float | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        return None
