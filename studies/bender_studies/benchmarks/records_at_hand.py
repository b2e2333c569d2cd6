"""Which of some named things a command was asked for, and where their records are."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")
DATA = Path("shared") / "data" / "rigs"


def wanted(option: str, names: Sequence[str] | None, known: Mapping[str, T]) -> list[T]:
    """Return what was asked for by name, each once; all of it where nothing was."""
    from bender_loop.errors import InputError

    for name in names or ():
        if name not in known:
            raise InputError(f"{option}: found {name!r}, expected one of {', '.join(map(repr, known))}")
    return [known[name] for name in dict.fromkeys(names or known)]


def data_folder(told: Path | None) -> Path:
    """Return the folder with the records: the one that was named, else the one beside the checkout."""
    from bender_export.build import checkout_folder

    folder = checkout_folder()
    return told if told is not None else DATA if folder is None else folder.parents[1] / DATA


def missing_of(files: Iterable[str], data: Path) -> list[str]:
    """Return the files that a folder lacks, each once."""
    return [x for x in dict.fromkeys(files) if not (data / x).is_file()]


def refuse_missing(missing: Sequence[str], data: Path, of: str) -> None:
    """Refuse a folder that lacks files."""
    from bender_loop.errors import InputError

    if missing:
        raise InputError(f"--data: {data} has no {', '.join(missing)}, expected the folder with the records of {of}")
