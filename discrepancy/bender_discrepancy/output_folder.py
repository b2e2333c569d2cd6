"""A directory whose files appear all together at the end, or not at all."""

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path

from bender_loop.errors import InputError
from bender_loop.shell.files import prepare_directory


@contextlib.contextmanager
def all_or_no_files(out: Path) -> Iterator[Path]:
    """Give a hidden directory near `out`; at the end its files move into `out`, on any failure they vanish.

    That `out` can be written is tried at once, before any work is lost. Directories that were made for it vanish with
    a failure as well; what lay in `out` before stays as it was.

    Raises:
        InputError: `out` cannot be written, or is a file.
    """
    made = _missing(out.parent)
    # inside a directory that is there: it may be a file system of its own, across which nothing moves in one go
    near = out if out.exists() else out.parent
    stage = near / f".{out.name}.{secrets.token_hex(4)}.tmp"
    try:
        prepare_directory(near)
        stage.mkdir()
        yield stage
        _move(stage, out)
    except BaseException:
        shutil.rmtree(stage, ignore_errors=True)
        for folder in made:
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


def _missing(folder: Path) -> list[Path]:
    """Return the folder and its parents as far as they do not exist, the innermost first."""
    return [x for x in (folder, *folder.parents) if not x.exists()]


def _move(stage: Path, out: Path) -> None:
    try:
        if not out.exists():
            os.replace(stage, out)
            return
        _move_into(stage, out)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror or error}); choose another place") from error


def _move_into(folder: Path, out: Path) -> None:
    """Move what a folder holds; a folder that is there already takes up the files of the new one."""
    for path in sorted(folder.iterdir()):
        there = out / path.name
        if path.is_dir() and there.is_dir():
            _move_into(path, there)
        else:
            os.replace(path, there)
    folder.rmdir()
