"""FMUs without Python: the C of a model, compiled for every platform at hand, with its sources in the archive."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any
from uuid import UUID

from bender_export.archive import packed
from bender_export.assembly import (
    Parts,
    controller_parts,
    following_parts,
    pages_of,
    plant_parts,
    reference_parts,
    stage_parts,
)
from bender_export.build import CLOSED_LOOP, CONTROLLER_FMU, PLANT_FMU
from bender_export.following import Makers
from bender_export.origin import documents_beside, with_documents
from bender_export.slaves.controller import table_of
from bender_export.slaves.plant import PiezoBender
from bender_export.slaves.shell import Row
from bender_export.slaves.stage import StageBeside, beside_table, stage_table
from bender_export.system import Loop, closed_loop_archive
from bender_loop.errors import InputError
from bender_loop.shell.files import prepare_directory, write_atomically
from bender_loop.shell.progress import Progress
from bender_loop.shell.run import doing
from bender_native.compilers import PLATFORMS, Platform, chosen, compiled, universal
from bender_native.description import build_description, fmi2_description, fmi3_description
from bender_native.following_source import following_source
from bender_native.model_source import Source
from bender_native.plant_source import plant_source, stage_source
from bender_native.slave_source import controller_source, reference_source
from bender_plant.model import Model, load_model
from bender_plant.parameter import ModelError

_LAYER = ("staged.h", "instance.h", "instance.c", "slopes.h")
_NO_SLOPES = "no_slopes.c"
_FMI_HEADERS = {
    2: ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    3: ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}


@dataclass(frozen=True, slots=True)
class Way:
    """How FMUs are made.

    Attributes:
        fmi: 2 or 3.
        platforms: what they carry libraries for; none for the sources only.
        note: what to tell the user about the choice, None for nothing.
    """

    fmi: int = 2
    platforms: tuple[Platform, ...] = ()
    note: str | None = None

    def __post_init__(self) -> None:
        if self.fmi not in _FMI_HEADERS:
            raise InputError(f"--fmi: found {self.fmi!r}, expected 2 or 3")


def way(fmi: int = 2, platforms: Sequence[str] | None = None) -> Way:
    """Return how FMUs are made with the compilers at hand.

    Args:
        fmi: 2 or 3.
        platforms: names of `compilers.PLATFORMS`, `all` or `none`; None for all that the compiler at hand can do.

    Raises:
        InputError: a name is no platform, there is no compiler for it, or there is no such version of FMI.
    """
    found, note = chosen(platforms)
    return Way(fmi, found, note)


def native_plant_fmu(model: Model, made: Way, own: bool = False) -> bytes:
    """Return the plant FMU of a model, without Python inside; the same model gives the same bytes, but for the date.

    Args:
        model: of the plant.
        made: how.
        own: prefer the machine's own compiler to ziglang.

    Raises:
        TranslationError: a kernel has a construct that the translator does not know; says which, where.
        RunError: the compiler failed.
    """
    doing("translating the blocks of the plant to C")
    sources = source_files(plant_source(model), plant_source(model, dual=True), made.fmi)
    guid = _guid(sources, repr(model.to_table()))
    return _archive("PiezoBender", sources, plant_parts(model, guid), made, own)


def native_stage_fmu(
    kind: type[PiezoBender], model: Model, made: Way, scale: float = 1.0, rest: float = 0.0, own: bool = False
) -> bytes:
    """Return stages of the chain as an FMU of their own, to stand before or behind a plant that is not ours.

    Args:
        kind: StagesBefore or StagesBehind.
        model: of the stages alone.
        made: how.
        scale: V or um per unit of the signal.
        rest: of the signal where the chain has 0, in its own unit.
        own: prefer the machine's own compiler to ziglang.

    Raises:
        TranslationError, RunError: as `native_plant_fmu`.
    """
    return _stage(kind, model, stage_table(kind, model, scale, rest), made, own)


def native_beside_fmu(
    model: Model, made: Way, sign: float, scales: tuple[float, float] = (1.0, 1.0), rest: float = 0.0, own: bool = False
) -> bytes:
    """Return a model as an FMU that stands beside a plant that is not ours: see `slaves.stage.StageBeside`.

    Args:
        model: of the plant, from V to um.
        made: how.
        sign: 1 adds what it shows to what the plant shows, -1 takes it off.
        scales: V per unit of the command, um per unit of what the plant shows.
        rest: of what the plant shows, in its own unit.
        own: prefer the machine's own compiler to ziglang.

    Raises:
        TranslationError, RunError: as `native_plant_fmu`.
    """
    return _stage(StageBeside, model, beside_table(model, sign, scales, rest), made, own)


def _stage(kind: type[PiezoBender], model: Model, table: tuple[Row, ...], made: Way, own: bool) -> bytes:
    plain, dual = (stage_source(kind, model, table, dual=x) for x in (False, True))
    sources = source_files(plain, dual, made.fmi)
    guid = _guid(sources, repr((kind.__name__, model.to_table(), table)))
    return _archive(kind.__name__, sources, stage_parts(model, guid, table), made, own)


def native_controller_fmu(made: Way, loop: Loop | None = None) -> bytes:
    """Return the FMU of the PID block, without Python inside.

    Args:
        made: how.
        loop: its controller's values are the start values, its step the one that the FMU proposes.

    Raises:
        RunError: the compiler failed.
    """
    loop = loop or Loop()
    doing("translating the PID block to C")
    plain, dual = (controller_source(x, loop.controller) for x in (False, True))
    sources = source_files(plain, dual, made.fmi)
    guid = _guid(sources, f"controller {dict(loop.controller)} {loop.step_s}")
    return _archive("PidController", sources, controller_parts(guid, table_of(loop.controller), loop.step_s), made)


def native_reference_fmu(made: Way) -> bytes:
    """Return the FMU of the setpoint that the closed loop carries, without Python inside.

    Raises:
        RunError: the compiler failed.
    """
    sources = source_files(reference_source(), reference_source(dual=True), made.fmi)
    return _archive("StaircaseReference", sources, reference_parts(_guid(sources, "reference")), made)


def native_following_fmu(settings: dict[str, Any], model: Model, made: Way) -> bytes:
    """Return the FMU of a model-following controller, without Python inside; it has no derivatives.

    Horizon and latency are those of the settings: its C is written for them.

    Args:
        settings: as `bender_export.following.following_settings` gives them.
        model: the one in them.
        made: how.

    Raises:
        TranslationError, RunError: as `native_plant_fmu`.
    """
    source, followed = following_source(settings)
    sources = source_files(source, None, made.fmi) | {name: text.encode() for name, text in followed.items()}
    parts = following_parts(settings, model, _guid(sources, repr(settings)))
    description = replace(parts[0], table=source.table)
    return _archive("ModelFollowingController", sources, (description, *parts[1:]), made)


def native_makers(made: Way) -> Makers:
    """Return the makers of FMUs without Python, of a model-following controller and its loop."""
    return Makers(
        lambda settings, model: native_following_fmu(settings, model, made),
        lambda model: native_plant_fmu(model, made),
        lambda: native_reference_fmu(made),
    )


def build_native(
    model: str | Path, plant_out: Path, folder: Path, made: Way, loop: Loop | None = None
) -> tuple[Path, ...]:
    """Write plant and controller FMU and the loop of both, all of them without Python inside.

    Args:
        model: built-in model or a model file.
        plant_out: the plant FMU; the archive of the loop stands beside it.
        folder: of the controller FMU.
        made: how.
        loop: how the loop is run; the controller FMU starts with its values.

    Raises:
        InputError: there is no such model, a file cannot be written, or the translator does not know a construct;
            nothing is written then.
        RunError: the compiler failed.
    """
    loop_out = plant_out.with_name(CLOSED_LOOP) if plant_out.name == PLANT_FMU else plant_out.with_suffix(".ssp")
    controller_out = folder / CONTROLLER_FMU
    if plant_out.suffix != ".fmu" or plant_out.is_dir():
        found = "a directory" if plant_out.is_dir() else f"the ending {plant_out.suffix!r}"
        raise InputError(f"{plant_out}: found {found}, expected the name of a file that ends with .fmu")
    if plant_out.resolve() == controller_out.resolve():
        raise InputError(f"{plant_out}: found the place of the controller FMU, expected another name for the plant")
    try:
        loaded = load_model(model)
    except ModelError as problem:
        raise InputError(str(problem)) from None
    plant = with_documents(native_plant_fmu(loaded, made), documents_beside(model, loaded))
    controller = native_controller_fmu(made, loop)
    system = closed_loop_archive(plant, controller, native_reference_fmu(made), loop or Loop())
    outs = {plant_out: plant, controller_out: controller, loop_out: system}
    for out in outs:
        prepare_directory(out.parent)
    for out, data in outs.items():
        write_atomically(out, data)
    return tuple(outs)


def source_files(source: Source, slopes: Source | None, fmi: int) -> dict[str, bytes]:
    """Return every C file of an FMU by name, but for its identity; without `slopes` it has no derivatives."""
    layer = files("bender_native") / "c"
    names = (*_LAYER, *source.headers, f"fmi{fmi}.c", *([] if slopes else [_NO_SLOPES]))
    found = {name: _text((layer / name).read_bytes()) for name in names}
    found |= {"model.h": source.header.encode(), "model.c": source.body.encode()}
    if slopes is not None:
        found["slopes.c"] = slopes.body.encode()
    return found | _fmi_headers(fmi)


def _text(data: bytes) -> bytes:
    return data.replace(b"\r\n", b"\n")


@cache
def _fmi_headers(fmi: int) -> dict[str, bytes]:
    """Return the headers of the standard, from FMPy's copy of them."""
    folder = files("fmpy") / "c-code"
    return {name: _text((folder / name).read_bytes()) for name in _FMI_HEADERS[fmi]}


def _guid(sources: dict[str, bytes], more: str) -> str:
    hasher = hashlib.sha256(more.encode())
    for name in sorted(sources):
        hasher.update(name.encode() + b"\0" + hashlib.sha256(sources[name]).digest())
    return f"{{{UUID(hex=hasher.hexdigest()[:32])}}}"


def _archive(name: str, sources: dict[str, bytes], parts: Parts, made: Way, own: bool = False) -> bytes:
    description, page, more = parts
    identity = f'#define MODEL_GUID "{description.guid}"\n#define MODEL_IDENTITY "{name} {description.guid}"\n'
    sources = sources | {"identity.h": identity.encode()}
    c_files = sorted(file for file in sources if file.endswith(".c"))
    entries = {f"sources/{file}": data for file, data in sources.items()}
    has_slopes = _NO_SLOPES not in sources
    libraries = _libraries(name, sources, made.platforms, own)
    if made.fmi == 2:
        # some tools look for any Mac's library under darwin64
        macs = {x: data for x, data in libraries.items() if x.endswith(("darwin64", "darwin"))}
        if macs:
            libraries["darwin64"] = universal(macs)
    for target in PLATFORMS:
        if target.name in libraries:
            folder = target.fmi2 if made.fmi == 2 else target.fmi3
            entries[f"binaries/{folder}/{name}{target.ending}"] = libraries[target.name]
    if made.fmi == 2:
        entries["modelDescription.xml"] = fmi2_description(name, description, c_files, has_slopes)
    else:
        entries["modelDescription.xml"] = fmi3_description(name, description, has_slopes)
        entries["sources/buildDescription.xml"] = build_description(name, c_files)
    entries |= pages_of(page) | more
    if made.fmi == 3:
        entries = {_fmi3_place(entry): data for entry, data in entries.items()}
    return packed(entries)


def _libraries(name: str, sources: dict[str, bytes], platforms: Sequence[Platform], own: bool) -> dict[str, bytes]:
    """Return the library for each platform; where there are several, say which is waited for."""
    if len(platforms) < 2:
        return {target.name: compiled(sources, name, target, own=own) for target in platforms}
    found: dict[str, bytes] = {}
    with Progress(f"compiling {name}") as bar:
        for target in platforms:
            text = f"for {target.name}; for the first time ziglang builds its C library as well, up to a minute"
            bar.update(len(found), len(platforms), text)
            found[target.name] = compiled(sources, name, target, own=own)
    return found


def _fmi3_place(entry: str) -> str:
    """Return where FMI 3.0 has an entry that FMI 2.0 has elsewhere."""
    return {"model.png": "terminalsAndIcons/icon.png"}.get(entry, entry)


__all__ = [
    "Way",
    "build_native",
    "native_beside_fmu",
    "native_controller_fmu",
    "native_following_fmu",
    "native_makers",
    "native_plant_fmu",
    "native_reference_fmu",
    "native_stage_fmu",
    "source_files",
    "way",
]
