"""Rules for the archive (FMI 2.0, section 2.3): names, integrity, binaries, documentation."""

import zipfile
from collections.abc import Iterator
from pathlib import PurePosixPath

import fmpy

from bender_loop.fmu.archive.binary import binary_fault, is_library
from bender_loop.fmu.archive.bounds import DAMAGE, archive_faults, name_faults
from bender_loop.fmu.check.findings import Finding, error, note, one_line, warning
from bender_loop.fmu.file import header_of

_REBUILD = "export or download the FMU anew"
_PIECE = 1 << 20
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def unbounded_findings(archive: zipfile.ZipFile) -> Iterator[Finding]:
    """Say why the archive is not even read through; nothing when it is bounded."""
    for fault in archive_faults(archive):
        yield error(
            fault,
            "whoever unpacks it fills the disk, or waits for ever",
            f"{_REBUILD}; do not open it with other tools",
        )


def archive_findings(archive: zipfile.ZipFile, identifiers: set[str], version: str = "2.0") -> Iterator[Finding]:
    """Check the archive of an FMU that `unbounded_findings` let through.

    Args:
        archive: opened for reading.
        identifiers: the model identifiers that its model description states.
        version: of FMI.
    """
    yield from _integrity(archive)
    names = archive.namelist()
    yield from _names(names)
    yield from _platforms(names, version)
    yield from _libraries(archive, identifiers)
    if "documentation/index.html" not in names and "documentation/_main.html" not in names:
        yield note(
            "documentation/index.html is missing",
            "tools show that page as the documentation of the model, and show none here",
            "add the page when you export the FMU",
        )


def platform_folder(version: str) -> str:
    """Return the folder under `binaries` that an FMU of that FMI version has for this platform."""
    return fmpy.platform_tuple if version.startswith("3.") else fmpy.platform


def _integrity(archive: zipfile.ZipFile) -> Iterator[Finding]:
    for entry in archive.infolist():
        if entry.compress_type not in _METHODS:
            yield error(
                f"{entry.filename}: compression method {entry.compress_type}",
                "FMUs are stored or deflated; importers unpack nothing else",
                "zip the archive again with the deflate method",
            )
            continue
        try:
            _read_through(archive, entry)
        except DAMAGE as problem:
            yield error(f"{entry.filename}: damaged ({one_line(problem)})", "the FMU cannot be unpacked", _REBUILD)


def _read_through(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> None:
    """Read an entry to its end, which checks its sum; piece by piece, for it may unpack to more than the memory."""
    with archive.open(entry) as file:
        while file.read(_PIECE):
            pass


def _names(names: list[str]) -> Iterator[Finding]:
    for name, fault in name_faults(names):
        if fault.startswith("stands"):
            yield error(f"{name}: {fault}", "which one is unpacked depends on the tool", _REBUILD)
        else:
            yield error(
                f"{name!r}: {fault}",
                "importers refuse to unpack such a file, since it may land outside its folder",
                "zip the archive again with forward slashes and relative names",
            )


def _platforms(names: list[str], version: str) -> Iterator[Finding]:
    binaries = [PurePosixPath(name) for name in names if name.startswith("binaries/") and not name.endswith("/")]
    platforms = sorted({path.parts[1] for path in binaries if len(path.parts) > 2})
    sources = any(name.startswith("sources/") for name in names)
    if not platforms and not sources:
        yield error(
            "neither a folder binaries/<platform> nor sources",
            "there is nothing to run",
            "export the FMU with a binary for your platform",
        )
    elif platform_folder(version) not in platforms:
        yield warning(
            f"no binary for this platform, {platform_folder(version)}; there are "
            f"{', '.join(platforms) or 'sources only'}",
            "the FMU cannot run on this machine, so the trial run is left out",
            "compile the sources that it carries: bender fmu compile FILE"
            if sources
            else "export the FMU on or for this platform, or run the check on one that it has a binary for",
        )


def _libraries(archive: zipfile.ZipFile, identifiers: set[str]) -> Iterator[Finding]:
    libraries = [path for name in archive.namelist() if is_library(path := PurePosixPath(name))]
    stems = {path.stem for path in libraries}
    for identifier in sorted(identifiers - stems):
        if any(name.startswith("binaries/") and not name.endswith("/") for name in archive.namelist()):
            others = f"there are {', '.join(sorted(stems))}" if stems else "there is no library"
            yield error(
                f"no binary is called {identifier}, as the modelIdentifier says; {others}",
                "importers look for binaries/<platform>/<modelIdentifier>",
                "make the names of the binaries and the modelIdentifier agree",
            )
    for path in libraries:
        if path.stem not in identifiers:
            continue
        try:
            header = header_of(archive, str(path))
        except DAMAGE:  # said above
            continue
        fault = binary_fault(path.parts[1], header, archive.getinfo(str(path)).file_size)
        if fault is not None:
            yield error(
                f"{path}: {fault}",
                "no importer on that platform can load it",
                "build the binary for the platform of its folder, or export the FMU anew",
            )
