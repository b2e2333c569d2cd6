"""Records on local disks and behind URLs (fsspec)."""

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any

from bender_loop.errors import InputError
from bender_loop.tables.containers import READERS

ENDINGS = {".csv", ".tsv", ".txt", ".dat", *READERS}
"""Of files in a directory that are taken for records."""


def is_url(place: str) -> bool:
    """Return whether a place is a URL such as s3://bucket/record.csv."""
    return "://" in place


def file_system(url: str) -> tuple[Any, str]:
    """Return the file system of a URL and the path in it.

    Raises:
        InputError: there is no such kind of URL, or what it needs is not installed.
    """
    import fsspec

    try:
        return fsspec.core.url_to_fs(url)
    except (ValueError, ImportError, OSError) as error:
        raise InputError(f"{url}: cannot be opened ({error})") from None


def matching(source: str) -> list[str]:
    """Return the records that a directory holds or a glob matches, or the one file, in the order of their names.

    Raises:
        InputError: there are none.
    """
    found = _far(source) if is_url(source) else _near(source)
    if not found:
        raise InputError(
            f"{source}: found no records, expected a directory with {', '.join(sorted(ENDINGS))}, a glob such as "
            "'records/*.csv', or a manifest with the columns unit and record"
        )
    return sorted(found)


def _near(source: str) -> list[str]:
    path = Path(source)
    if path.is_dir():
        return [str(x) for x in path.iterdir() if x.is_file() and x.suffix.lower() in ENDINGS]
    if path.is_file():
        return [source]
    import glob

    return [x for x in glob.glob(source, recursive=True) if Path(x).is_file()]


def _far(source: str) -> list[str]:
    system, path = file_system(source)
    scheme = source.partition("://")[0]
    try:
        if any(mark in path for mark in "*?["):
            found = [str(x) for x in system.glob(path)]
        elif system.isdir(path):
            found = [str(x) for x in system.ls(path, detail=False)]
            found = [x for x in found if PurePosixPath(x).suffix.lower() in ENDINGS]
        else:
            found = [path] if system.exists(path) else []
    except OSError as error:
        raise InputError(f"{source}: cannot be read ({error})") from None
    return [x if is_url(x) else f"{scheme}://{x}" for x in found]


@contextlib.contextmanager
def local_copy(place: str) -> Iterator[Path]:
    """Give a local file with the content of a place: the file itself, or a copy that vanishes afterwards.

    Raises:
        InputError: a URL cannot be read.
    """
    if not is_url(place):
        yield Path(place)
        return
    with TemporaryDirectory() as folder:
        path = Path(folder) / PurePosixPath(place).name
        system, there = file_system(place)
        try:
            with system.open(there, "rb") as source, path.open("wb") as copy:
                shutil.copyfileobj(source, copy)
        except OSError as error:
            raise InputError(f"{place}: cannot be read ({error.strerror or error})") from None
        yield path


def bytes_of(place: str) -> int:
    """Return how large a record is, 0 where that is not known."""
    try:
        if is_url(place):
            system, path = file_system(place)
            return int(system.size(path) or 0)
        return Path(place).stat().st_size
    except (OSError, ValueError, InputError):
        return 0
