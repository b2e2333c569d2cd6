"""Rules for the archive (FMI 2.0, section 2.3): names, integrity, binaries, documentation."""

import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import fmpy

from bender_loop.fmu.check.findings import Finding, error, note, one_line, warning

_ENDINGS = {"linux": ".so", "win": ".dll", "darwin": ".dylib"}
_REBUILD = "export or download the FMU anew"
_PIECE = 1 << 20
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def archive_findings(archive: zipfile.ZipFile, identifiers: set[str]) -> Iterator[Finding]:
    """Check the archive of an FMU.

    Args:
        archive: opened for reading.
        identifiers: the model identifiers that its model description states.
    """
    yield from _integrity(archive)
    names = archive.namelist()
    yield from _names(names)
    yield from _binaries(names, identifiers)
    if "documentation/index.html" not in names and "documentation/_main.html" not in names:
        yield note(
            "documentation/index.html is missing",
            "tools show that page as the documentation of the model, and show none here",
            "add the page when you export the FMU",
        )


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
        except (zipfile.BadZipFile, zlib.error, OSError, EOFError, RuntimeError, NotImplementedError) as problem:
            yield error(f"{entry.filename}: damaged ({one_line(problem)})", "the FMU cannot be unpacked", _REBUILD)


def _read_through(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> None:
    """Read an entry to its end, which checks its sum; piece by piece, for it may unpack to more than the memory."""
    with archive.open(entry) as file:
        while file.read(_PIECE):
            pass


def _names(names: list[str]) -> Iterator[Finding]:
    for name, count in Counter(names).items():
        if count > 1:
            yield error(
                f"{name}: stands {count} times in the archive", "which one is unpacked depends on the tool", _REBUILD
            )
        path = PurePosixPath(name)
        if path.is_absolute() or ".." in path.parts or "\\" in name or ":" in name:
            yield error(
                f"{name!r}: not a relative path with forward slashes inside the archive",
                "importers refuse to unpack such a file, since it may land outside its folder",
                "zip the archive again with forward slashes and relative names",
            )


def _binaries(names: list[str], identifiers: set[str]) -> Iterator[Finding]:
    binaries = [PurePosixPath(name) for name in names if name.startswith("binaries/") and not name.endswith("/")]
    platforms = sorted({path.parts[1] for path in binaries if len(path.parts) > 2})
    sources = any(name.startswith("sources/") for name in names)
    if not platforms and not sources:
        yield error(
            "neither a folder binaries/<platform> nor sources",
            "there is nothing to run",
            "export the FMU with a binary for your platform",
        )
        return
    if fmpy.platform not in platforms:
        yield warning(
            f"no binary for this platform, {fmpy.platform}; there are {', '.join(platforms) or 'sources only'}",
            "the FMU cannot run on this machine, so the trial run is left out",
            "export the FMU on or for this platform, or run the check on one that it has a binary for",
        )
    stems = {path.stem for path in binaries if path.suffix == _ENDINGS.get(path.parts[1].rstrip("0123456789"))}
    for identifier in sorted(identifiers):
        if platforms and identifier not in stems:
            yield error(
                f"no binary is called {identifier}, as the modelIdentifier says; there are {', '.join(sorted(stems))}",
                "importers look for binaries/<platform>/<modelIdentifier>",
                "make the names of the binaries and the modelIdentifier agree",
            )


def readable_archive(path: Path) -> zipfile.ZipFile:
    """Open the archive of an FMU.

    Raises:
        OSError: the file cannot be read.
        zipfile.BadZipFile: it is no archive.
    """
    return zipfile.ZipFile(path)
