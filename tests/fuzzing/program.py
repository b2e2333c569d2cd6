"""The installed `bender`, found by its entry point: what is attacked is the program, whole."""

from importlib import import_module
from importlib.metadata import entry_points
from types import ModuleType

from bender_loop.errors import RunError


def installed() -> ModuleType:
    """Return the module behind `bender`: `main`, `COMMANDS`, `command_parser`.

    Raises:
        RunError: nothing is installed.
    """
    for point in entry_points(group="console_scripts", name="bender"):
        return import_module(f"{point.module.rpartition('.')[0]}.main")
    raise RunError("no program of the name bender is installed; install it: pip install -e .")
