"""What goes into an FMU, and the hash of it: the source of every name in the archive that must not clash.

PythonFMU runs every FMU of a process in one interpreter with one table of modules, so two FMUs whose modules bear the
same name run the code of whichever was loaded first. Names made from the content cannot meet unless the content does.
"""

import hashlib
import inspect
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any
from uuid import UUID

from bender_loop.tables.quantities import USUAL
from bender_plant.blocks import BLOCKS

_SHELL = "bender_export.slaves.shell"
_PLANT = "bender_plant"
_PID = "bender_loop.control.pid"
_CONTROL = "bender_loop.control"
_PID_SLAVE = "bender_export.slaves.controller"
FOLLOWING_MODULES = ("model_following", "inverse", "shaper", "pid", "plant")
"""Modules of `bender_loop.control` that a model-following controller carries; standard library only."""
# PythonFMU runs the script anew for each instance, keeps every class that it defines, and lets go of the module's names
# once more than it took hold of them. So the slave stands in a module of its own, and the script holds its names.
_SCRIPT = """\
from {module} import {slave}
from {shell} import HELD

HELD.append(globals())
"""


@dataclass(frozen=True, slots=True)
class Content:
    """The Python side of one FMU.

    Attributes:
        guid: identifies the content; another version of anything in it has another one.
        script: name of the slave script without its ending.
        files: what stands under `resources/`, by path.
    """

    guid: str
    script: str
    files: dict[str, bytes]


def plant_content(table: Mapping[str, Any]) -> Content:
    """Return script, shell and plant package for the model that a table describes."""
    model_json = json.dumps(table, indent=1)
    sources = _package_sources(files(_PLANT), _PLANT) | _added_blocks(table)
    slave = _text(_slaves() / "plant.py")
    digest = _digest({**sources, "slave": slave, "model": model_json})
    names = {_SHELL: f"bender_shell_{digest[:12]}", _PLANT: f"{_PLANT}_{digest[:12]}"}
    script = _filled(_renamed(slave, names), 'MODEL_JSON = ""', f'MODEL_JSON = r"""\n{model_json}\n"""')
    return _content(digest, f"piezo_bender_{digest[:12]}", "PiezoBender", script, names, _bundled(sources, names))


def _added_blocks(table: Mapping[str, Any]) -> dict[str, str]:
    """Return the blocks of other packages in a model, as files beside those of the chain."""
    ids = [block["id"] for block in table.get("block", ())]
    modules = {name: BLOCKS[name].module for name in ids if not BLOCKS[name].module.__name__.startswith(f"{_PLANT}.")}
    return {f"{_PLANT}/blocks/{name}.py": inspect.getsource(module) for name, module in modules.items()}


def controller_content(start: Mapping[str, float] | None = None, units: tuple[str, str] = USUAL[:2]) -> Content:
    """Return script, shell and PID block of the controller.

    Args:
        start: start values of its parameters in place of its own, by name.
        units: of command and reading; the block takes and gives others as they stand, V, and m as the gains' um.
    """
    start_json, units_json = json.dumps(dict(start or {})), json.dumps(units)
    pid = _text(files("bender_loop") / "control" / "pid.py")
    slave = _text(_slaves() / "controller.py")
    digest = _digest({"slave": slave, "pid": pid, "start": start_json, "units": units_json})
    names = {_SHELL: f"bender_shell_{digest[:12]}", _PID: f"bender_pid_{digest[:12]}"}
    bundled = {f"{names[_PID]}.py": pid.encode()}
    script = _filled(_renamed(slave, names), 'START_JSON = "{}"', f'START_JSON = r"""{start_json}"""')
    if units != USUAL[:2]:
        script = _filled(script, 'UNITS_JSON = \'["V", "um"]\'', f'UNITS_JSON = r"""{units_json}"""')
        script = _filled(script, "1e6 * values[0], 1e6 * values[1]", "values[0], values[1]")
        script = _filled(
            script, "{command!r} V from setpoint {values[0]!r} m and", "{command!r} from setpoint {values[0]!r} and"
        )
        script = _filled(script, "measurement {values[1]!r} m, ", "measurement {values[1]!r}, ")
    return _content(digest, f"pid_controller_{digest[:12]}", "PidController", script, names, bundled)


def following_content(settings: Mapping[str, Any]) -> Content:
    """Return script, shell, control modules and plant package of a model-following controller.

    Args:
        settings: as `bender_export.slaves.following` takes them.
    """
    settings_json = json.dumps(settings, indent=1)
    plant = _package_sources(files(_PLANT), _PLANT) | _added_blocks(settings["model"])
    control = {
        f"{_CONTROL}/{name}.py": _text(files("bender_loop") / "control" / f"{name}.py") for name in FOLLOWING_MODULES
    }
    slave, pid_slave = (_text(_slaves() / name) for name in ("following.py", "controller.py"))
    digest = _digest({**plant, **control, "slave": slave, "settings": settings_json})
    names = {
        _SHELL: f"bender_shell_{digest[:12]}",
        _PID_SLAVE: f"bender_pid_slave_{digest[:12]}",
        _CONTROL: f"bender_control_{digest[:12]}",
        _PLANT: f"{_PLANT}_{digest[:12]}",
    }
    bundled = _bundled({**plant, **control, f"{_CONTROL}/__init__.py": "", f"{_PID_SLAVE}.py": pid_slave}, names)
    script = _filled(_renamed(slave, names), 'SETTINGS_JSON = ""', f'SETTINGS_JSON = r"""\n{settings_json}\n"""')
    name = f"model_following_controller_{digest[:12]}"
    return _content(digest, name, "ModelFollowingController", script, names, bundled)


def reference_content() -> Content:
    """Return script and shell of the reference."""
    slave = _text(_slaves() / "reference.py")
    digest = _digest({"slave": slave})
    names = {_SHELL: f"bender_shell_{digest[:12]}"}
    return _content(
        digest, f"staircase_reference_{digest[:12]}", "StaircaseReference", _renamed(slave, names), names, {}
    )


def _content(
    digest: str, script_name: str, identity: str, script: str, names: Mapping[str, str], bundled: dict[str, bytes]
) -> Content:
    guid = f"{{{UUID(hex=digest[:32])}}}"
    script = _filled(script, f'IDENTITY = "{identity}"\n', f'IDENTITY = "{identity} {guid}"\n')
    bundled[f"{names[_SHELL]}.py"] = _text(_slaves() / "shell.py").encode()
    module = f"{script_name.rpartition('_')[0]}_slave_{digest[:12]}"
    bundled[f"{module}.py"] = script.encode()
    bundled[f"{script_name}.py"] = _SCRIPT.format(module=module, slave=identity, shell=names[_SHELL]).encode()
    return Content(guid, script_name, bundled)


def _slaves() -> Traversable:
    return files("bender_export") / "slaves"


def _text(file: Traversable) -> str:
    return file.read_bytes().decode("utf-8").replace("\r\n", "\n")


def _package_sources(folder: Traversable, prefix: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for item in sorted(folder.iterdir(), key=lambda item: item.name):
        if item.is_dir() and item.name != "__pycache__":
            found |= _package_sources(item, f"{prefix}/{item.name}")
        elif item.name.endswith(".py"):
            found[f"{prefix}/{item.name}"] = _text(item)
    return found


def _digest(parts: Mapping[str, str]) -> str:
    """Hash the parts with everything else that shapes an FMU: this package and the version of PythonFMU."""
    shared = _package_sources(files("bender_export"), "bender_export")
    pages = {f"pages/{item.name}": item.read_bytes().hex() for item in (files("bender_export") / "pages").iterdir()}
    whole = {**shared, **pages, **parts, "pythonfmu": _pythonfmu_version()}
    hasher = hashlib.sha256()
    for name in sorted(whole):
        data = whole[name].encode()
        hasher.update(f"{name} {len(data)}\n".encode())
        hasher.update(data)
    return hasher.hexdigest()


def _pythonfmu_version() -> str:
    """Return the version of the installed PythonFMU, whatever copy of it an opened FMU has put in the way."""
    try:
        return version("pythonfmu")
    except PackageNotFoundError:
        return "none"


def _renamed(source: str, names: Mapping[str, str]) -> str:
    for name, hashed in names.items():
        source, count = re.subn(rf"^from {re.escape(name)}(?=[. ])", f"from {hashed}", source, flags=re.MULTILINE)
        if count == 0:
            raise LookupError(f"the slave script imports nothing from {name}")
    return source


def _bundled(sources: Mapping[str, str], names: Mapping[str, str]) -> dict[str, bytes]:
    """Return files of packages and modules as they stand under other names, by those."""
    found: dict[str, bytes] = {}
    for path, source in sources.items():
        for name, hashed in names.items():
            path = path.replace(name, hashed, 1) if path.startswith((f"{name}/", f"{name}.py")) else path
            source = re.sub(rf"^( *from ){re.escape(name)}(?=[. ])", rf"\g<1>{hashed}", source, flags=re.MULTILINE)
        found[path] = source.encode()
    return found


def _filled(source: str, old: str, new: str) -> str:
    if source.count(old) != 1:
        raise LookupError(f"the slave script has {source.count(old)} times {old!r}, expected once")
    return source.replace(old, new)
