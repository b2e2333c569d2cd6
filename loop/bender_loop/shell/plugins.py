"""What other installed packages add: record formats, supplies, effects, each under a group of entry points."""

from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from bender_loop.errors import InputError

RECORD_FORMATS = "piezo_bender.record_formats"
SUPPLIES = "piezo_bender.supplies"
EFFECTS = "piezo_bender.effects"


@cache
def added(group: str) -> dict[str, EntryPoint]:
    """Return what is added under a group, by name; nothing is imported."""
    return {point.name: point for point in entry_points(group=group)}


def loaded(group: str, name: str) -> Any:
    """Return the object of a name.

    Raises:
        InputError: its package cannot be imported.
    """
    point = added(group)[name]
    try:
        return point.load()
    except Exception as error:  # another's code fails in its own way
        package = point.dist.name if point.dist else "unknown"
        raise InputError(
            f"{group}: {name} of the package {package} cannot be loaded ({type(error).__name__}: {error}); "
            "mend the package or uninstall it"
        ) from None
