"""What other installed packages add: record formats, sources, sensors, effects, each under a group of entry points."""

from collections.abc import Mapping
from dataclasses import is_dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from bender_loop.errors import InputError

RECORD_FORMATS = "piezo_bender.record_formats"
SUPPLIES = "piezo_bender.supplies"
SOURCES = "piezo_bender.sources"
SENSORS = "piezo_bender.sensors"
EFFECTS = "piezo_bender.effects"
A_CLASS_OF_YOURS = "a class in a package of yours (docs/how-to/write-a-source-or-sensor.md)"
"""What adds a source or a sensor that no list has."""


@cache
def installed_plugins(group: str) -> dict[str, EntryPoint]:
    """Return what is added under a group, by name; nothing is imported."""
    return {point.name: point for point in entry_points(group=group)}


def package_of(group: str, name: str) -> str:
    """Return the name of the package that adds a name."""
    point = installed_plugins(group)[name]
    return point.dist.name if point.dist else "unknown"


def load_plugin(group: str, name: str) -> Any:
    """Return the object of a name.

    Raises:
        InputError: its package cannot be imported.
    """
    point = installed_plugins(group)[name]
    try:
        return point.load()
    except Exception as error:  # another's code fails in its own way
        raise InputError(
            f"{group}: {name} of the package {package_of(group, name)} cannot be loaded "
            f"({type(error).__name__}: {error}); mend the package or uninstall it"
        ) from None


def known_kinds(group: str, ours: Mapping[str, type]) -> list[str]:
    """Return the names of a group, ours first."""
    return [*ours, *(name for name in installed_plugins(group) if name not in ours)]


def settings_class(group: str, ours: Mapping[str, type], kind: str, what: str) -> type[Any]:
    """Return the settings of a kind of source or sensor: a dataclass with a method `make`.

    Raises:
        InputError: there is no such kind, its package is broken or gives something else.
    """
    if kind in ours:
        return ours[kind]
    if kind not in installed_plugins(group):
        raise InputError(
            f"{what}.kind: found {kind!r:.60}, expected one of {', '.join(known_kinds(group, ours))}; another one is "
            "added by a package of yours (docs/how-to/write-a-source-or-sensor.md)"
        )
    found = load_plugin(group, kind)
    if not (isinstance(found, type) and is_dataclass(found) and callable(getattr(found, "make", None))):
        raise InputError(f"{group}: {kind}: found {found!r:.60}, expected a dataclass with a method make")
    return found


def check_complete(made: object, protocol: type) -> None:
    """Check that what `make` gave has everything that its protocol names.

    Raises:
        ValueError: something is missing.
    """
    names = [name for name in (*vars(protocol), *getattr(protocol, "__annotations__", ())) if not name.startswith("_")]
    missing = [name for name in names if not hasattr(made, name)]
    if missing:
        raise ValueError(
            f"make gave a {type(made).__name__} without {', '.join(missing)} "
            "(docs/how-to/write-a-source-or-sensor.md says what it needs)"
        )
    cannot = getattr(made, "cannot", ())
    if isinstance(cannot, str):
        raise ValueError(f"{type(made).__name__}.cannot: found {cannot!r:.60}, expected a tuple of sentences")
