"""FMUs on demand: build them, or find that the one that is there is still the right one."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import bender_export
from bender_export.archive import guid_of
from bender_export.content import Content, controller_content, plant_content, reference_content
from bender_export.origin import documents_beside, with_documents
from bender_export.platform_support import require_support
from bender_loop.errors import InputError
from bender_loop.shell.files import prepare_directory, write_atomically
from bender_plant.model import BUILT_IN, Model, load_model
from bender_plant.parameter import ModelError

if TYPE_CHECKING:
    from bender_export.system import Loop

PLANT_FMU = "PiezoBender.fmu"
CONTROLLER_FMU = "PidController.fmu"
CLOSED_LOOP = "ClosedLoop.ssp"


def build_plant_fmu(model: Model, out: Path) -> Path:
    """Write the plant FMU of a model; returns its path.

    Raises:
        InputError: `out` does not end with .fmu, or its directory cannot be written.
    """
    return _written(plant_fmu(model), out)


def build_all(model: str | Path, plant_out: Path, folder: Path, loop: "Loop | None" = None) -> tuple[Path, Path, Path]:
    """Write plant and controller FMU of a built-in model or a model file, and the loop of both.

    Args:
        model: name or path of the model.
        plant_out: the plant FMU. The archive of the loop stands beside it: `ClosedLoop.ssp` for one called
            `PiezoBender.fmu`, else under the same name with the ending .ssp.
        folder: of the controller FMU.
        loop: how the loop is run; the controller FMU starts with its values.

    Raises:
        InputError: there is no such model, or a file cannot be written; nothing is written then.
    """
    loaded = _loaded(model)
    loop_out = plant_out.with_name(CLOSED_LOOP) if plant_out.name == PLANT_FMU else plant_out.with_suffix(".ssp")
    outs = plant_out, folder / CONTROLLER_FMU, loop_out
    if plant_out.resolve() == outs[1].resolve():
        raise InputError(f"{plant_out}: found the place of the controller FMU, expected another name for the plant")
    for out in outs[:2]:
        _checked_place(out)
    _checked_place(loop_out, ".ssp")
    plant = with_documents(plant_fmu(loaded), documents_beside(model, loaded))
    controller = controller_fmu(loop)
    for out, data in zip(outs, (plant, controller, closed_loop(plant, controller, loop)), strict=True):
        write_atomically(out, data)
    return outs


def plant_fmu(model: Model) -> bytes:
    """Return the plant FMU of a model; the same model gives the same bytes, but for the date."""
    from bender_export.assembly import plant_archive

    return plant_archive(model, plant_content(model.to_table()))


def controller_fmu(loop: "Loop | None" = None) -> bytes:
    """Return the FMU of the PID block; the same sources and loop give the same bytes, but for the date.

    Args:
        loop: its controller's values are the start values, its step the one that the FMU proposes.
    """
    from bender_export.assembly import controller_archive
    from bender_export.system import Loop

    loop = loop or Loop()
    return controller_archive(controller_content(loop.controller), loop.controller, loop.step_s)


def build_controller_in_units(loop: "Loop", units: tuple[str, str], folder: Path) -> Path:
    """Write the FMU of the PID block for a device of other quantities than volts and lengths.

    Args:
        loop: its controller's values are the start values, its step the one that the FMU proposes.
        units: of command and reading, as they go in and out.
        folder: of the FMU.

    Raises:
        InputError: the file cannot be written.
    """
    from bender_export.assembly import controller_archive

    content = controller_content(loop.controller, units)
    return _written(controller_archive(content, loop.controller, loop.step_s, units), folder / CONTROLLER_FMU)


def reference_fmu() -> bytes:
    """Return the FMU of the setpoint of the closed loop; the same sources give the same bytes, but for the date."""
    from bender_export.assembly import reference_archive

    return reference_archive(reference_content())


def closed_loop(plant: bytes, controller: bytes, loop: "Loop | None" = None) -> bytes:
    """Return the SSP archive of the closed loop around a plant FMU and the controller FMU."""
    from bender_export.system import Loop, closed_loop_archive

    return closed_loop_archive(plant, controller, reference_fmu(), loop or Loop())


def ensure_plant_fmu(model: str | Path = "paper") -> Path:
    """Return an up-to-date plant FMU of a built-in model or a model file, built where missing or stale.

    Raises:
        InputError: there is no such model, or no place where the FMU can be written.
        RunError: FMUs made here cannot run on this machine.
    """
    loaded = _loaded(model)
    if str(model) not in BUILT_IN:
        return ensure_plant_fmu_of(loaded)
    require_support()
    content = plant_content(loaded.to_table())
    name = PLANT_FMU if str(model) == "paper" else f"PiezoBender-{model}.fmu"
    places = [folder / name for folder in _folders()]
    return _current(places, content) or _placed(plant_fmu(loaded), places, content)


def ensure_plant_fmu_of(model: Model) -> Path:
    """Return an up-to-date FMU of a model that is in memory, kept in the cache.

    Raises:
        InputError: there is no place where the FMU can be written.
        RunError: FMUs made here cannot run on this machine.
    """
    require_support()
    content = plant_content(model.to_table())
    places = [cache_folder() / f"PiezoBender-{_tag(content)}.fmu"]
    return _current(places, content) or _placed(plant_fmu(model), places, content)


def ensure_controller_fmu() -> Path:
    """Return an up-to-date controller FMU, built where missing or stale.

    Raises:
        InputError: there is no place where the FMU can be written.
        RunError: FMUs made here cannot run on this machine.
    """
    require_support()
    content = controller_content()
    places = [folder / CONTROLLER_FMU for folder in _folders()]
    return _current(places, content) or _placed(controller_fmu(), places, content)


def checkout_folder() -> Path | None:
    """Return the `fmu/` of the checkout that this code runs from, None for an installed package."""
    root = Path(bender_export.__file__ or "").resolve().parents[2]
    return root / "fmu" if (root / "build_fmu.py").is_file() and (root / "fmu").is_dir() else None


def cache_folder() -> Path:
    """Return the user's folder for FMUs of this project."""
    from bender_loop.shell.cache import cache_folder as folder

    return folder()


def _folders() -> list[Path]:
    """List the folders for FMUs of this project, the preferred one first; a checkout may be read-only."""
    checkout = checkout_folder()
    return [cache_folder()] if checkout is None else [checkout, cache_folder()]


def _tag(content: Content) -> str:
    return re.sub(r"[^0-9a-f]", "", content.guid)[:12]


def _current(places: Sequence[Path], content: Content) -> Path | None:
    return next((place for place in places if guid_of(place) == content.guid), None)


def _placed(data: bytes, places: Sequence[Path], content: Content) -> Path:
    """Write to the first place that can be written."""
    refusals: list[InputError] = []
    for place in places:
        try:
            return _written(data, place)
        except InputError as problem:
            refusals.append(problem)
    # another process may hold the file open, and be the one that has just put it there
    made_elsewhere = _current(places, content)
    if made_elsewhere is None:
        raise refusals[-1]
    return made_elsewhere


def _loaded(model: str | Path) -> Model:
    try:
        return load_model(model)
    except ModelError as problem:
        raise InputError(str(problem)) from None


def _written(data: bytes, out: Path) -> Path:
    _checked_place(out)
    write_atomically(out, data)
    return out


def _checked_place(out: Path, ending: str = ".fmu") -> None:
    if out.suffix != ending or out.is_dir():
        found = "a directory" if out.is_dir() else f"the ending {out.suffix!r}"
        raise InputError(f"{out}: found {found}, expected the name of a file that ends with {ending}")
    prepare_directory(out.parent)
