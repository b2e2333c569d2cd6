"""Keys made of the content of records, model and settings: equal keys mean equal results."""

import hashlib
import json
import re
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from bender_fleet.sources.places import file_system, is_url

_LONGEST_NAME = 80
_DIGITS = 20


def key_of(records: Iterable[str], work: dict[str, Any]) -> str:
    """Return the key of a unit's work: of its records' content, of what is done with them, and of our version.

    A record behind a URL counts by what its file system says of it (checksum, or size and time); one that cannot be
    read counts as missing, so that the unit is done again when it is there.
    """
    known = {"version": _version(), "work": work, "records": [_digest(x) for x in records]}
    text = json.dumps(known, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal digits.

    Raises:
        OSError: it cannot be read, or is no regular file: a device would be read without end.
    """
    if not path.is_file():
        raise FileNotFoundError(path)
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def folder_name(unit: str) -> str:
    """Return a name for the files of a unit that every file system takes; other units have other names."""
    safe = re.sub(r"[^A-Za-z0-9_-]", "_", unit)[:_LONGEST_NAME]
    if safe == unit and safe.lower() == safe:
        return safe
    return f"{safe}-{hashlib.sha256(unit.encode()).hexdigest()[:8]}"


def _digest(place: str) -> str:
    try:
        if is_url(place):
            system, path = file_system(place)
            return str(system.ukey(path))
        return file_digest(Path(place))
    except (OSError, ValueError):
        return "missing"


def _version() -> str:
    try:
        return version("piezo-bender")
    except PackageNotFoundError:
        return "unknown"
