"""TOML files, read within bounds of size and depth."""

import tomllib
from pathlib import Path
from typing import Any

from bender_loop.errors import InputError
from bender_loop.shell.files import read_text_file

MOST_BYTES = 1 << 20
DEEPEST = 12
_LONGEST_REASON = 160


def read_toml_file(path: Path, what: str) -> dict[str, Any]:
    """Return the table that a TOML file holds.

    Args:
        path: of the file.
        what: what the file should be, for the message, such as "a bench file (TOML)".

    Raises:
        InputError: the file cannot be read, is not TOML, or nests deeper than any file of ours.
    """
    text = read_text_file(path, MOST_BYTES, what)
    try:
        table = tomllib.loads(text)
    except ValueError as error:
        reason = " ".join(str(error).split())[:_LONGEST_REASON]
        raise InputError(f"{path}: is not valid TOML: {reason}; expected {what}") from error
    except RecursionError as error:
        raise InputError(f"{path}: is not valid TOML: it nests too deeply; expected {what}") from error
    if _depth(table) > DEEPEST:
        raise InputError(f"{path}: its tables nest deeper than {DEEPEST} levels; expected {what}")
    return table


def _depth(table: dict[str, Any]) -> int:
    """Return the number of levels, counted only as far as it matters."""
    level: list[Any] = [table]
    for depth in range(DEEPEST + 1):
        level = [
            part
            for parent in level
            for part in (parent.values() if isinstance(parent, dict) else parent)
            if isinstance(part, dict | list)
        ]
        if not level:
            return depth + 1
    return DEEPEST + 1
