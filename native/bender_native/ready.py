"""The plant FMU that the commands run: without Python where a C compiler is at hand, else that of PythonFMU.

Both give the same numbers to the last bit; the one without Python is several times faster, and runs where PythonFMU has
no binary.
"""

import hashlib
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from bender_export.archive import guid_of
from bender_export.build import cache_folder, ensure_plant_fmu, ensure_plant_fmu_of
from bender_export.content import plant_content
from bender_loop.errors import InputError, RunError
from bender_loop.shell.files import prepare_directory, write_atomically
from bender_native.build import Way, native_plant_fmu
from bender_native.compilers import Platform, own_compiler, own_platform
from bender_plant.model import Model, load_model
from bender_plant.parameter import ModelError


def ready_plant_fmu(model: str | Path | Model = "paper") -> Path:
    """Return an up-to-date plant FMU of a model, built where missing or stale.

    Args:
        model: built-in model, a model file, or a model in memory.

    Raises:
        InputError: there is no such model, or no place where the FMU can be written.
        RunError: there is neither a C compiler for this platform nor a PythonFMU that runs on it.
    """
    target = own_platform()
    if target is None or own_compiler() is None:
        return _of_pythonfmu(model)
    try:
        loaded = model if isinstance(model, Model) else load_model(model)
    except ModelError as problem:
        raise InputError(str(problem)) from None
    try:
        return _native(loaded, target)
    except (InputError, RunError):
        # a compiler that does not work or a cache that cannot be written: the other FMU gives the same numbers
        return _of_pythonfmu(model)


def _of_pythonfmu(model: str | Path | Model) -> Path:
    return ensure_plant_fmu_of(model) if isinstance(model, Model) else ensure_plant_fmu(model)


def _native(model: Model, target: Platform) -> Path:
    key = f"{plant_content(model.to_table()).guid} {_translator()} {target.name}"
    path = cache_folder() / f"PiezoBender-native-{hashlib.sha256(key.encode()).hexdigest()[:16]}.fmu"
    if guid_of(path) is None:
        data = native_plant_fmu(model, Way(2, (target,)), own=True)
        prepare_directory(path.parent)
        write_atomically(path, data)
    return path


@cache
def _translator() -> str:
    """Return a hash of everything in this room: another translator makes another FMU."""
    hasher = hashlib.sha256()
    for name, data in sorted(_texts(files("bender_native"), "").items()):
        hasher.update(f"{name}\0{len(data)}\0".encode() + data)
    return hasher.hexdigest()


def _texts(folder: Traversable, under: str) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    for entry in folder.iterdir():
        name = f"{under}{entry.name}"
        if entry.is_dir() and entry.name != "__pycache__":
            found |= _texts(entry, f"{name}/")
        elif entry.name.endswith((".py", ".c", ".h")):
            found[name] = entry.read_bytes()
    return found
