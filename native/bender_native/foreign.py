"""Other makers' FMUs that carry sources only: compiled for this machine, on request."""

import os
import subprocess
import tempfile
from pathlib import Path, PurePosixPath
from typing import Any

import fmpy

from bender_export.archive import packed, unpacked
from bender_loop.errors import InputError, RunError
from bender_loop.fmu.archive.bounds import DAMAGE, unpack
from bender_loop.fmu.file import co_simulation, is_fmi3, own_folder, read_description
from bender_loop.shell.files import prepare_directory, write_atomically
from bender_native.compilers import compiler_words, own_compiler, own_platform

LANGUAGES = {"C89": "gnu89", "C90": "gnu90", "C99": "gnu99", "C11": "gnu11", "C17": "gnu17"}
_TIMEOUT_S = 600.0


def compile_fmu(path: Path, out: Path) -> Path:
    """Write a copy of an FMU with a binary for this machine, made from the sources that it carries.

    Args:
        path: an FMU of FMI 2.0 or 3.0 for co-simulation.
        out: the copy.

    Raises:
        InputError: the FMU is not fit, has no sources in C, or `out` is no name for the copy; nothing is written.
        RunError: there is no compiler, or it failed; its first message is in the sentence.
    """
    if out.suffix != ".fmu" or (out.exists() and (not out.is_file() or out.samefile(path))):
        raise InputError(f"{out}: found the FMU itself or no name of a file, expected another name that ends with .fmu")
    description = read_description(path, needs_binary=False)
    identifier = str(co_simulation(description).modelIdentifier)
    configuration = next((x for x in description.buildConfigurations if x.modelIdentifier in (None, identifier)), None)
    if configuration is None or not any(x.sourceFiles for x in configuration.sourceFileSets):
        raise InputError(f"{path}: found no list of sources for {identifier}, expected an FMU that carries its sources")
    folder = own_folder(is_fmi3(description))
    with tempfile.TemporaryDirectory(prefix="bender_compile_") as scratch:
        place = Path(scratch)
        try:
            (place / "fmu").mkdir()
            unpack(path, place / "fmu")
            entries = unpacked(path)
        except DAMAGE as problem:
            if isinstance(problem, InputError):
                raise
            raise InputError(f"{path}: damaged ({problem}); get or build the FMU anew") from None
        library = _library(path, place, identifier, configuration.sourceFileSets)
        entries[f"binaries/{folder}/{identifier}{fmpy.sharedLibraryExtension}"] = library
    prepare_directory(out.parent)
    write_atomically(out, packed(entries))
    return out


def _library(path: Path, place: Path, identifier: str, sets: list[Any]) -> bytes:
    target = own_platform()
    if target is None:
        raise RunError("this machine's platform has no name in FMI, expected Linux, Windows or macOS on 64 bit")
    compiler = compiler_words(target, own_compiler() is not None)
    sources = place / "fmu" / "sources"
    objects = []
    for files in sets:
        flags = _flags(path, files, sources)
        for name in files.sourceFiles:
            source = sources / _inside(path, name)
            if not source.is_file():
                raise InputError(f"{path}: found no file sources/{name}, expected it: the FMU names it as a source")
            objects.append(f"{len(objects)}.o")
            _run([*compiler, *flags, "-c", str(source), "-o", objects[-1]], place)
    out = place / f"{identifier}{fmpy.sharedLibraryExtension}"
    _run([*compiler, "-shared", *objects, "-o", out.name, *([] if os.name == "nt" else ["-lm"])], place)
    return out.read_bytes()


def _flags(path: Path, files: Any, sources: Path) -> list[str]:
    if files.language not in (None, "", *LANGUAGES):
        raise InputError(f"{path}: found sources in {files.language}, expected one of {', '.join(LANGUAGES)}")
    folders = [sources, *(sources / _inside(path, str(x)) for x in files.includeDirectories or ())]
    definitions = [f"-D{x.name}={x.value}" if x.value else f"-D{x.name}" for x in files.preprocessorDefinitions]
    # the headers of the standard, where the FMU does not bring them; functions without the prefix of static linking
    headers = Path(fmpy.__file__).parent / "c-code"
    return [
        f"-std={LANGUAGES.get(files.language or 'C99')}", "-O2", "-ffp-contract=off", "-w",
        *([] if os.name == "nt" else ["-fPIC"]),
        "-DFMI2_OVERRIDE_FUNCTION_PREFIX", "-DFMI3_OVERRIDE_FUNCTION_PREFIX",
        *definitions, *(f"-I{x}" for x in folders), f"-I{headers}",
    ]  # fmt: skip


def _inside(path: Path, name: str) -> PurePosixPath:
    place = PurePosixPath(name)
    if place.is_absolute() or ".." in place.parts or "\\" in name or name.startswith("-"):
        raise InputError(f"{path}: found the source {name!r}, expected a name inside the folder sources")
    return place


def _run(words: list[str], place: Path) -> None:
    try:
        done = subprocess.run(words, cwd=place, capture_output=True, text=True, check=False, timeout=_TIMEOUT_S)
    except (OSError, subprocess.TimeoutExpired) as problem:
        raise RunError(f"{words[0]}: {problem}") from None
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if "error" in line] or done.stderr.splitlines()
        said = (lines or ["no message"])[0].replace(f"{place}/", "")
        raise RunError(f"{words[0]}: the sources cannot be compiled, status {done.returncode}: {said}")


__all__ = ["compile_fmu"]
