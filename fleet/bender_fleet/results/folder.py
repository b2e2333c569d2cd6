"""The output directory: whose it is, and what an earlier run left."""

import json
from pathlib import Path
from typing import Any

from bender_fleet.results.parts import UNITS
from bender_loop.errors import InputError
from bender_loop.shell.files import prepare_directory, read_text_file, write_result

FLEET = "fleet.json"
_MOST_BYTES = 1 << 28


def refuse_others(out: Path, action: str) -> None:
    """Refuse a directory that holds something else than an earlier run of the same action.

    Raises:
        InputError: it is a file, holds other files, or another action's results.
    """
    if not out.exists():
        return
    if not out.is_dir():
        raise InputError(f"{out}: found a file, expected a directory for the results; choose another one")
    if not any(out.iterdir()):
        return
    before = read_fleet(out, missing_ok=True)
    if before is None:
        raise InputError(
            f"{out}: found files that are not of a fleet, expected an empty directory, or one of an earlier run of "
            "the same fleet; choose another one with --out"
        )
    if before["action"] != action:
        raise InputError(
            f"{out}: found the results of bender fleet {before['action']}, expected an empty directory for {action}; "
            "choose another one with --out"
        )


def open_folder(out: Path, told: dict[str, Any]) -> None:
    """Make the directory and write down whose it is.

    Raises:
        InputError: it cannot be written.
    """
    prepare_directory(out)
    prepare_directory(out / UNITS)
    write_fleet(out, told)


def write_fleet(out: Path, told: dict[str, Any]) -> None:
    """Write what is known of the run."""
    write_result(out / FLEET, told)


def read_fleet(out: Path, *, missing_ok: bool = False) -> dict[str, Any] | None:
    """Return what an earlier run wrote down of itself.

    Raises:
        InputError: there is none, unless that is allowed, or it is not readable.
    """
    path = out / FLEET
    if not path.is_file():
        if missing_ok:
            return None
        raise InputError(f"{out}: found no {FLEET}, expected the output directory of bender fleet")
    try:
        found = json.loads(read_text_file(path, _MOST_BYTES, "what a fleet wrote of itself"))
        if not isinstance(found, dict) or not isinstance(found.get("action"), str):
            raise ValueError("no action in it")
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: found {error}, expected a file of bender fleet; choose another --out") from None
    return found
