"""What can be said of an FMU file before it is loaded."""

import tomllib
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
from fmpy.model_description import ModelDescription, read_model_description

from bender_loop.errors import InputError
from bender_loop.fmu.archive.binary import HEADER_BYTES, binary_fault
from bender_loop.fmu.archive.bounds import DAMAGE, refuse_unbounded

DESCRIPTION = "modelDescription.xml"
OWN_MODEL = "resources/model.toml"
"""In an FMU that this project has made of a model: its equations."""
VERSIONS = ("2.0", "3.0")
_TIMES = ("startTime", "stopTime", "stepSize", "tolerance")
LARGEST_DESCRIPTION = 1 << 28
"""In bytes, 256 MiB; the descriptions of the largest models known take some tens."""

_LARGEST_MODEL, _WITHIN = 1 << 24, 1e-6


def read_text(archive: zipfile.ZipFile) -> bytes:
    """The model description as it stands in the archive.

    Raises:
        BadZipFile: it unpacks to more than any model needs.
    """
    size = archive.getinfo(DESCRIPTION).file_size
    if size > LARGEST_DESCRIPTION:
        raise zipfile.BadZipFile(f"{DESCRIPTION} unpacks to {size} bytes, expected at most {LARGEST_DESCRIPTION}")
    return archive.read(DESCRIPTION)


def read_description(path: Path, needs_binary: bool = True) -> ModelDescription:
    """The model description of a co-simulation FMU of FMI 2.0 or 3.0 that has a binary for this platform.

    Args:
        path: of the FMU.
        needs_binary: False to take it without a binary for this platform, too.

    Raises:
        InputError: the file is missing or damaged, or is not such an FMU; the message says what it is instead.
    """
    path = Path(path)
    if path.is_dir():
        inside = ", ".join(sorted(x.name for x in path.glob("*.fmu"))) or "none"
        raise InputError(f"{path}: a folder, expected an FMU; FMUs in it: {inside}")
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected an FMU")
    try:
        with zipfile.ZipFile(path) as archive:
            refuse_unbounded(path, archive)
            names = archive.namelist()
            text = read_text(archive) if DESCRIPTION in names else None
    except InputError:
        raise
    except (OSError, RuntimeError) as error:
        raise InputError(f"{path}: cannot be read ({error}), expected an FMU") from error
    except DAMAGE as error:
        raise InputError(f"{path}: not a zip archive or damaged ({error}), expected an FMU") from error
    if text is None:
        raise InputError(f"{path}: no modelDescription.xml in the archive, expected an FMU")
    _check_kind(path, text)
    description = _parse(path)
    _check_variables(path, description)
    if needs_binary:
        _check_platform(path, names, co_simulation(description).modelIdentifier, own_folder(is_fmi3(description)))
    return description


def is_of_this_project(path: Path) -> bool:
    """Return whether an FMU that `read_description` let through was made here, of a model and of nobody else's code."""
    with zipfile.ZipFile(path) as archive:
        return OWN_MODEL in archive.namelist()


def learned_range(path: Path) -> tuple[float, float] | None:
    """Return the lowest and highest command that the model in an FMU was learned from; None where it does not say.

    Args:
        path: of an FMU that `read_description` let through, of any maker.
    """
    with zipfile.ZipFile(path) as archive:
        inside = OWN_MODEL in archive.namelist() and archive.getinfo(OWN_MODEL).file_size <= _LARGEST_MODEL
        text = archive.read(OWN_MODEL) if inside else b""
    try:
        valid = tomllib.loads(text.decode("utf-8"))["valid"]
        return float(valid["lowest_V"]), float(valid["highest_V"])
    except (ValueError, LookupError, TypeError):
        return None


def beyond_learned(commands: Sequence[float], learned: tuple[float, float] | None, unit: str) -> str:
    """Return what is said of commands outside those that a model was learned from; empty where none is.

    Args:
        commands: in `unit`.
        learned: lowest and highest; None where nothing is known.
        unit: of commands.
    """
    if learned is None or not commands:
        return ""
    (low, high), rounding = learned, _WITHIN * (learned[1] - learned[0])
    if min(commands) >= low - rounding and max(commands) <= high + rounding:
        return ""
    ends = sorted({f"{min(commands):.4g}", f"{max(commands):.4g}"}, key=float)
    return (
        f"this takes a command of {' to '.join(ends)} {unit}, the model was learned from "
        f"{low:.4g} to {high:.4g} {unit}: beyond, it extrapolates, and misses by more than its diagnosis says"
    )


def header_of(archive: zipfile.ZipFile, name: str) -> bytes:
    """The first bytes of an entry, as many as `binary_fault` looks at."""
    with archive.open(name) as file:
        return file.read(HEADER_BYTES)


def co_simulation(description: ModelDescription) -> Any:
    """The co-simulation part of a description that `read_description` let through."""
    return description.coSimulation


def _check_kind(path: Path, text: bytes) -> None:
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{path}: modelDescription.xml is not well-formed ({error})") from error
    version = root.get("fmiVersion")
    if version not in VERSIONS:
        wanted = " or ".join(VERSIONS)
        raise InputError(
            f"{path}: found FMI version {version or 'none'}, expected {wanted}; export the FMU for one of these"
        )
    if root.find("CoSimulation") is None:
        raise InputError(f"{path}: found a model-exchange FMU, expected co-simulation; export it for co-simulation")
    # before FMPy reads the file: some of its versions only say that they cannot
    stated = getattr(root.find("DefaultExperiment"), "attrib", {})
    for name in _TIMES:
        _check_number(path, f"DefaultExperiment, {name}", stated.get(name))


def _parse(path: Path) -> ModelDescription:
    try:
        return read_model_description(str(path), validate=False)
    except Exception as error:  # the parser raises bare Exception, KeyError and others for faults of the file
        raise InputError(f"{path}: modelDescription.xml cannot be used ({_one_line(error)})") from error


def _check_variables(path: Path, description: ModelDescription) -> None:
    for variable in description.modelVariables:
        if variable.type in ("Real", "Float64"):
            for name in ("min", "max", "nominal"):
                _check_number(path, f"{variable.name}, {name}", getattr(variable, name))


def _check_number(path: Path, place: str, text: str | float | None) -> None:
    try:
        float(text or 0.0)
    except ValueError:
        raise InputError(
            f"{path}: modelDescription.xml, {place}: found {text!r}, expected a number; export the FMU anew"
        ) from None


def own_folder(fmi3: bool) -> str:
    """Return the folder under `binaries` for this platform, as FMI 2.0 or 3.0 calls it."""
    return fmpy.platform_tuple if fmi3 else fmpy.platform


def is_fmi3(description: ModelDescription) -> bool:
    """Return whether a description is one of FMI 3.0."""
    return str(description.fmiVersion).startswith("3.")


def _check_platform(path: Path, names: list[str], identifier: str | None, folder: str) -> None:
    binary = f"binaries/{folder}/{identifier}{fmpy.sharedLibraryExtension}"
    if binary in names:
        _check_binary(path, binary)
        return
    folders = sorted({name.split("/")[1] for name in names if name.startswith("binaries/") and name.count("/") > 1})
    remedy = f"; it carries sources: bender fmu compile {path}" if any(x.startswith("sources/") for x in names) else ""
    raise InputError(
        f"{path}: no binary {binary} for this platform, found binaries for {', '.join(folders) or 'none'}{remedy}"
    )


def _check_binary(path: Path, binary: str) -> None:
    try:
        with zipfile.ZipFile(path) as archive:
            fault = binary_fault(binary.split("/")[1], header_of(archive, binary), archive.getinfo(binary).file_size)
    except DAMAGE as error:
        raise InputError(f"{path}: {binary} is damaged ({_one_line(error)}); get or build the FMU anew") from error
    if fault is not None:
        raise InputError(f"{path}: {binary}: {fault}; export or download the FMU anew, for this platform")


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
