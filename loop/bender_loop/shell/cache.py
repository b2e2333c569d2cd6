"""Where compiled code and built FMUs are kept between runs, how much that is, and how it is cleared.

All of it is made again where it is missing.
"""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bender_loop.errors import InputError

NAME = "piezo-bender"


@dataclass(frozen=True, slots=True)
class CachedFiles:
    """Files of one kind in the cache: how many, and how large together."""

    kind: str
    files: int
    size_bytes: int


def cache_folder() -> Path:
    """Return the user's folder for what commands build and compile; it need not be there."""
    from platformdirs import user_cache_path

    return user_cache_path(NAME)


def cached_files(folder: Path) -> Sequence[CachedFiles]:
    """Return what the cache holds, kind by kind."""
    found = {"FMUs": [0, 0], "compiled kernels": [0, 0], "others": [0, 0]}
    for path in _files(folder):
        kind = "FMUs" if path.suffix == ".fmu" else "compiled kernels" if path.parent != folder else "others"
        with contextlib.suppress(OSError):  # another command may have cleared it
            found[kind][1] += path.stat().st_size
            found[kind][0] += 1
    return [CachedFiles(kind, *numbers) for kind, numbers in found.items()]


def clear(folder: Path) -> None:
    """Remove every file of the cache and the folders that are empty then.

    Raises:
        InputError: a file cannot be removed; it may be in use.
    """
    for path in _files(folder):
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise InputError(f"{path}: cannot be removed ({error.strerror}); is a bender running?") from error
    for place in sorted((x for x in folder.rglob("*") if x.is_dir() and not x.is_symlink()), reverse=True):
        with contextlib.suppress(OSError):
            place.rmdir()


def _files(folder: Path) -> list[Path]:
    """Return the files below a folder; a link is a file that is removed itself, not what it points to."""
    return [path for path in folder.rglob("*") if path.is_symlink() or path.is_file()] if folder.is_dir() else []
