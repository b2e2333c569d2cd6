"""Files that are written whole or not at all, and text files that are read within bounds."""

import contextlib
import os
import secrets
from pathlib import Path

from bender_loop.errors import InputError
from bender_loop.shell.bounded import in_one_line, read_bounded


def write_atomically(path: Path, data: str | bytes) -> None:
    """Write `data` to `path` by way of a temporary name in the same directory.

    Text is encoded as UTF-8 and its line ends are kept as they are. A file that was there before is replaced in
    one move; when anything fails it stays as it was and nothing else is left behind.

    Raises:
        InputError: the directory is missing or cannot be written, or `path` is a directory.
    """
    path = Path(path)
    payload = data.encode("utf-8") if isinstance(data, str) else data
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        temporary.write_bytes(payload)
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); choose another place") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def prepare_directory(path: Path) -> Path:
    """Create the directory `path` with its parents where it is missing and try that files can be made in it.

    Call it after the input has been checked: the directory is the first thing that a command writes.

    Raises:
        InputError: the directory cannot be created or written, or the name belongs to a file.
    """
    path = Path(path)
    probe = path / f".{secrets.token_hex(4)}.tmp"
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe.touch(exist_ok=False)
        probe.unlink()
    except OSError as error:
        raise InputError(
            f"{path}: cannot be used as output directory ({error.strerror or error}); choose another one"
        ) from error
    return path


def unused(path: Path) -> Path:
    """Return a path where nothing is yet: this one, or the first free one with a number behind it, from 2 on.

    For results whose place the user did not name: those of an earlier run stay, and do not mix with new ones.
    """
    number, found = 1, path
    while found.exists():
        number += 1
        found = path.with_name(f"{path.name}-{number}")
    return found


def read_text_file(path: Path, most_bytes: int, what: str) -> str:
    """Return the text of a regular file, without a byte order mark; line ends are kept as they are.

    Nothing is waited for and no more than `most_bytes` + 1 bytes are ever read: a pipe, a device, a folder and a file
    that is too large are refused. Text is UTF-8 without NUL characters.

    Args:
        path: of the file.
        most_bytes: size of the largest file that is read.
        what: what the file should be, for the message, such as "a bench file (TOML)".

    Raises:
        InputError: the file cannot be opened, is not a regular file, is too large, or is not such text.
    """
    name = in_one_line(path)
    data = read_bounded(path, most_bytes, what)
    if (place := data.find(0)) >= 0:
        raise InputError(f"{name}: byte {place} is NUL, expected {what} in UTF-8")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{name}: byte {error.start} is not UTF-8 text, expected {what}") from error
