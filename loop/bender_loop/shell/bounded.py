"""Reading of files that may be anything: a pipe that nobody writes to, a device without end, the wrong file."""

import os
import stat
from pathlib import Path

from bender_loop.errors import InputError
from bender_loop.shell.run import note_input

MOST_RECORD_BYTES = 1 << 30
"""1 GiB, some ten million rows."""


_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


def read_bounded(path: Path, most_bytes: int, what: str) -> bytes:
    """Return the content of a regular file.

    Args:
        path: the file.
        most_bytes: a longer one is refused before it is read.
        what: was expected, as "a model file (TOML)", for the message.

    Raises:
        InputError: it is missing, no regular file, too long, or cannot be read.
    """
    name = in_one_line(path)
    try:
        if not stat.S_ISREG(mode := os.stat(path).st_mode):
            raise InputError(f"{name}: found {_kind(mode)}, expected {what}, a regular file")
        # opened without waiting: a pipe without a writer would hold this process for ever
        with os.fdopen(os.open(path, _FLAGS), "rb") as file:
            found = os.fstat(file.fileno())
            if not stat.S_ISREG(found.st_mode):
                raise InputError(f"{name}: found {_kind(found.st_mode)}, expected {what}, a regular file")
            data = file.read(most_bytes + 1)
    except InputError:
        raise
    except (OSError, ValueError) as error:  # ValueError: a name with a zero byte
        raise InputError(f"{name}: cannot be read ({_reason(error)}); expected {what}") from error
    if len(data) > most_bytes:
        raise InputError(f"{name}: found more than {most_bytes} bytes, expected {what} of at most that size")
    note_input(path, data)
    return data


def refuse_no_file(path: Path, what: str) -> None:
    """Refuse a pipe, a device or a socket, which would be read without end; a folder or nothing at all is none.

    Raises:
        InputError: it is one; `what` was expected.
    """
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError(f"{in_one_line(path)}: found {_kind(mode)}, expected {what}")


def _kind(mode: int) -> str:
    if stat.S_ISDIR(mode):
        return "a directory"
    return "a pipe" if stat.S_ISFIFO(mode) else "a device or socket"


def _reason(error: OSError | ValueError) -> str:
    return error.strerror or str(error) if isinstance(error, OSError) else str(error)


def in_one_line(path: Path) -> str:
    """Return the path with its unprintable characters escaped, so that a message stays one line."""
    return "".join(mark if mark.isprintable() else ascii(mark)[1:-1] for mark in str(path))
