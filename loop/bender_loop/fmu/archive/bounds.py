"""What an archive may be before a byte of it is unpacked.

Sizes are those that the archive states. They bind: `zipfile` never gives out more of an entry than its stated size.
"""

import lzma
import shutil
import stat
import struct
import tempfile
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from bender_loop.errors import InputError

MOST_BYTES = 4 << 30
"""Of all entries unpacked, 4 GiB; the largest FMUs known, with meshes and look-up tables, take some hundred MiB."""
MOST_ENTRIES = 50_000
"""FMUs with sources hold some thousand files."""
MOST_RATIO = 200
"""Unpacked over packed; text and tables come to 5 to 50, a file of zeros to 1000."""
SMALL_BYTES = 256 << 20
"""Up to this total the ratio does not matter: it harms nobody."""
_SHARE_OF_FREE_SPACE = 0.5
DAMAGE = (
    zipfile.BadZipFile, zipfile.LargeZipFile, zlib.error, lzma.LZMAError, struct.error, ValueError, NotImplementedError,
    EOFError, RuntimeError, OSError,
)  # fmt: skip
"""What reading an archive raises that is damaged, in any of the ways of packing that it may name."""


def archive_faults(archive: zipfile.ZipFile) -> Iterator[str]:
    """Say what forbids to unpack or to read through `archive`; nothing when it is bounded."""
    entries = archive.infolist()
    if len(entries) > MOST_ENTRIES:
        yield f"the archive has {len(entries)} entries, expected at most {MOST_ENTRIES}"
        return
    total = sum(entry.file_size for entry in entries)
    packed = max(1, sum(entry.compress_size for entry in entries))
    if total > MOST_BYTES:
        yield f"the archive unpacks to {_size(total)}, expected at most {_size(MOST_BYTES)}"
    elif total > SMALL_BYTES and total > MOST_RATIO * packed:
        yield (
            f"the archive unpacks to {_size(total)}, {total / packed:.0f} times its own size, expected at most "
            f"{MOST_RATIO} times"
        )


def name_faults(names: list[str]) -> Iterator[tuple[str, str]]:
    """Say which names of entries are unsafe or double, each with what is wrong with it."""
    for name, count in Counter(names).items():
        if count > 1:
            yield name, f"stands {count} times in the archive"
        path = PurePosixPath(name)
        if path.is_absolute() or ".." in path.parts or "\\" in name or ":" in name or "\0" in name:
            yield name, "not a relative path with forward slashes inside the archive"


def unpack(path: Path, folder: Path) -> None:
    """Unpack the FMU at `path` into `folder`.

    Raises:
        InputError: it is too large, leaves the folder, holds a link, or does not fit on the disk; nothing was unpacked.
        OSError, RuntimeError, zipfile.BadZipFile, zlib.error: it is damaged.
    """
    with zipfile.ZipFile(path) as archive:
        refuse_unbounded(path, archive)
        for name, fault in name_faults(archive.namelist()):
            raise InputError(f"{path}: {name!r}: {fault}; get or build the FMU anew")
        for entry in archive.infolist():
            if stat.S_ISLNK(entry.external_attr >> 16):
                raise InputError(f"{path}: {entry.filename!r}: a symbolic link, expected files; build the FMU anew")
        total, free = sum(entry.file_size for entry in archive.infolist()), shutil.disk_usage(folder).free
        if total > _SHARE_OF_FREE_SPACE * free:
            raise InputError(
                f"{path}: unpacks to {_size(total)}, more than half of the {_size(free)} that are free in "
                f"{tempfile.gettempdir()}; free some space or set TMPDIR"
            )
        archive.extractall(folder)


def refuse_unbounded(path: Path, archive: zipfile.ZipFile) -> None:
    """Raise InputError where `archive_faults` finds something."""
    for fault in archive_faults(archive):
        raise InputError(f"{path}: {fault}; get or build the FMU anew")


def _size(count: int) -> str:
    for unit, scale in (("GiB", 30), ("MiB", 20), ("KiB", 10)):
        if count >= 1 << scale:
            return f"{count / (1 << scale):.3g} {unit}"
    return f"{count} bytes"
