"""The checkers of others: the schema of the standard, FMPy's validation, fmutool's semantic check where installed."""

import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import fmpy
from fmpy.validation import validate_fmu
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from bender_loop.fmu.check.findings import Finding, error, one_line

_SCHEMAS = {
    "1.0": "fmi1/fmiModelDescription.xsd",
    "2.0": "fmi2/fmi2ModelDescription.xsd",
    "3.0": "fmi3/fmi3ModelDescription.xsd",
}
_EXPORT = "correct modelDescription.xml, or export the FMU anew with a tool that does"
_EXPLAINED = (
    (
        r"InitialUnknowns",
        "the list of what is computed at the start is incomplete; strict importers refuse the FMU",
        "list every output, calculated parameter and state with initial calculated or approx under InitialUnknowns",
    ),
    (
        r"ModelStructure/Outputs|not listed in <Outputs>",
        "importers find the outputs by that list",
        "list every variable with causality output under ModelStructure/Outputs, and nothing else",
    ),
    (
        r"must have variability|cannot be continuous",
        "whole numbers and Booleans move in jumps; solvers would treat the variable as smooth",
        "give the variable the variability discrete, or fixed or tunable for a parameter",
    ),
    (
        r"no start value|start value is required",
        "the first value of that variable is unknown",
        "give the variable a start value",
    ),
    (r"combination causality|cannot be combined", "the standard does not allow it (FMI 2.0, section 2.2.7)", _EXPORT),
    (r"not unique|used by several", "tools find variables by their names", "rename one of the variables"),
    (r"unit .*not defined", "the unit cannot be converted", "define the unit under UnitDefinitions"),
    (
        r"legal variable name",
        "the names promise a structure that they do not have",
        "set variableNamingConvention to flat, or rename",
    ),
    (
        r"schema|element|attribute",
        "the file is not what the standard's schema asks for; strict importers refuse it",
        _EXPORT,
    ),
)
_SKIPPED = "does not validate with FMI standard", "semantic error(s) against", "error(s) found"
_FMUTOOL_SECONDS = 60


def schema_findings(version: str, text: bytes) -> Iterator[Finding]:
    """Hold a model description against the schema of its version."""
    if version not in _SCHEMAS:
        return
    schema = etree.XMLSchema(etree.parse(Path(fmpy.__file__).parent / "schema" / _SCHEMAS[version]))
    try:
        document = etree.fromstring(text, etree.XMLParser(resolve_entities=False, no_network=True))
    except etree.XMLSyntaxError as problem:
        yield explained(f"modelDescription.xml: schema: {one_line(problem)}")
        return
    if not schema.validate(document):
        for entry in schema.error_log:
            yield explained(f"modelDescription.xml, line {entry.line}: schema: {one_line(entry.message)}")


def fmpy_findings(path: Path) -> Iterator[Finding]:
    """Run FMPy's validation; faults that it stumbles over are findings, too."""
    try:
        problems = validate_fmu(str(path))
    except Exception as problem:  # it raises KeyError, AttributeError and the bare class for faults of the file
        problems = [f"fmpy cannot validate the model description ({type(problem).__name__}: {one_line(problem)})"]
    for problem in problems:
        text = one_line(problem)
        if "Failed to validate modelDescription.xml" not in text:  # the schema's findings, one by one above
            yield explained(f"fmpy: {text}")


def fmutool_findings(path: Path) -> Iterator[Finding]:
    """Run `fmutool -check` where it is installed."""
    if not fmutool_installed():
        return
    code = "from fmu_manipulation_toolbox.cli.fmutool import fmutool; fmutool()"
    words = [sys.executable, "-P", "-c", code, "-input", str(path), "-check"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=_FMUTOOL_SECONDS)
    except subprocess.TimeoutExpired:
        yield explained(f"fmutool: no answer within {_FMUTOOL_SECONDS} s")
        return
    for line in (done.stdout + done.stderr).splitlines():
        level, _, text = line.partition("|")
        if level.strip() in ("ERROR", "FATAL", "CRITICAL") and not any(words in text for words in _SKIPPED):
            yield explained(f"fmutool: {one_line(text)}")


def fmutool_installed() -> bool:
    """Whether the FMU Manipulation Toolbox is there."""
    return find_spec("fmu_manipulation_toolbox") is not None


def explained(what: str) -> Finding:
    """The finding of another checker with an explanation of what it means."""
    for pattern, why, remedy in _EXPLAINED:
        if re.search(pattern, what):
            return error(what, why, remedy)
    return error(what, "the model description breaks a rule of the standard", _EXPORT)
