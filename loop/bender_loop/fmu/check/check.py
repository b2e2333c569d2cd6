"""All checks of an FMU, one after the other."""

import zipfile
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import fmpy

from bender_loop.errors import InputError
from bender_loop.fmu.check.archive import archive_findings, unbounded_findings
from bender_loop.fmu.check.description import description_findings, model_identifiers
from bender_loop.fmu.check.findings import Finding, error, one_line
from bender_loop.fmu.check.standard import fmpy_findings, fmutool_findings, fmutool_installed, schema_findings
from bender_loop.fmu.check.trial_process import trial_findings
from bender_loop.fmu.file import VERSIONS, own_folder, read_text

_VERSIONS = ("1.0", "2.0", "3.0")


@dataclass(frozen=True, slots=True)
class Report:
    """What the checks of an FMU gave.

    Attributes:
        findings: errors, warnings and notes in the order of the checks.
        ran: the checks that ran.
        left_out: those that did not, with the reason.
    """

    findings: tuple[Finding, ...]
    ran: tuple[str, ...]
    left_out: tuple[str, ...]

    @property
    def faults(self) -> tuple[Finding, ...]:
        """The findings that are more than a note."""
        return tuple(finding for finding in self.findings if finding.severity != "note")


def check(path: Path, *, trial: bool = True) -> Report:
    """Run every check at hand.

    Args:
        path: the FMU.
        trial: whether to run it as well, in a process of its own.

    Raises:
        InputError: the file is missing or is not an FMU.
    """
    # before anything is opened: a device or a pipe would be read without end
    if not path.is_file():
        raise InputError(f"{path}: found no file, expected an FMU (`bender fmu build` makes those of this project)")
    unbounded = _unbounded(path)
    if unbounded:
        return Report(unbounded, ("archive",), ("everything else: the archive is not read through",))
    text = _description_text(path)
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as problem:
        what = f"modelDescription.xml: not well-formed ({one_line(problem)})"
        finding = error(what, "no tool can read the FMU", "export or download the FMU anew")
        return _unread(path, finding, "everything else: the model description cannot be read")
    version = root.get("fmiVersion", "none")
    if not version.startswith(_VERSIONS):
        finding = error(f"fmiVersion is {version!r}", "known versions are 1.0, 2.0 and 3.0", "export it for FMI 2.0")
        return _unread(path, finding, "everything else: no rules are known for that version")
    return _checked(path, root, text, version, trial)


def _unread(path: Path, finding: Finding, left_out: str) -> Report:
    with zipfile.ZipFile(path) as archive:
        return Report((finding, *archive_findings(archive, set())), ("archive",), (left_out,))


def _checked(path: Path, root: ElementTree.Element, text: bytes, version: str, trial: bool) -> Report:
    findings: list[Finding] = []
    ran, left_out = ["archive", "schema", "fmpy"], []
    with zipfile.ZipFile(path) as archive:
        findings += archive_findings(archive, model_identifiers(root), version)
        names = archive.namelist()
    findings += schema_findings(version, text)
    findings += fmpy_findings(path)
    if version == "2.0":
        findings += description_findings(root)
        ran.append("rules")
    else:
        left_out.append(f"rules: for FMI 2.0 only, this one is {version}")
    if not fmutool_installed():
        left_out.append("fmutool: not installed (pip install fmu-manipulation-toolbox)")
    elif version == "2.0":
        findings += fmutool_findings(path)
        ran.append("fmutool")
    reason = _no_trial(root, names, version) if trial else "not asked for"
    if reason:
        left_out.append(f"trial run: {reason}")
    else:
        findings += trial_findings(path)
        ran.append("trial run")
    return Report(tuple(findings), tuple(ran), tuple(left_out))


def _no_trial(root: ElementTree.Element, names: list[str], version: str) -> str:
    if version not in VERSIONS:
        return f"for FMI {' and '.join(VERSIONS)} only, this one is {version}"
    interface = root.find("CoSimulation")
    if interface is None:
        return "for co-simulation only, this one is for model exchange"
    identifier = interface.get("modelIdentifier")
    binary = f"binaries/{own_folder(version != '2.0')}/{identifier}{fmpy.sharedLibraryExtension}"
    return "" if binary in names else f"no binary {binary}"


def _unbounded(path: Path) -> tuple[Finding, ...]:
    try:
        with zipfile.ZipFile(path) as archive:
            return tuple(unbounded_findings(archive))
    except Exception:  # what is wrong with the file is said where the model description is read
        return ()


def _description_text(path: Path) -> bytes:
    wanted = "expected an FMU, a zip archive with modelDescription.xml at its top"
    try:
        with zipfile.ZipFile(path) as archive:
            return read_text(archive)
    except KeyError:
        raise InputError(f"{path}: found no model description, {wanted}") from None
    except Exception as problem:  # a damaged archive raises struct.error, zlib.error, UnicodeDecodeError and others
        raise InputError(f"{path}: found no model description ({one_line(problem)}), {wanted}") from problem
