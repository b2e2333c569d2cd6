"""Every failure of a command as an exit status and one line that a person can act on."""

import errno
import os
import traceback

from bender_loop.errors import InputError, RunError

FAILED, BAD_INPUT = 1, 2
_LONGEST_LINE = 800
_NOT_THE_USERS_PATH = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EMFILE, errno.ENOMEM)


def status_and_sentence(error: Exception) -> tuple[int, str]:
    """Return the exit status and the sentence of a failure."""
    if isinstance(error, InputError):
        return BAD_INPUT, str(error)
    if isinstance(error, RunError):
        return FAILED, str(error)
    if isinstance(error, OSError):
        return _judge_os_error(error)
    if isinstance(error, MemoryError):
        return FAILED, "out of memory; use a shorter record or close other programs"
    if os.environ.get("BENDER_TRACEBACK"):
        traceback.print_exception(error)
    hint = "set BENDER_TRACEBACK=1 to see where, and please report it"
    return FAILED, f"a fault in bender itself: {type(error).__name__}: {error}; {hint}"


def _judge_os_error(error: OSError) -> tuple[int, str]:
    reason = error.strerror or str(error) or type(error).__name__
    where = f"{error.filename}: " if error.filename is not None else ""
    if error.errno == errno.ENOENT and error.filename is None and not _has_working_folder():
        return BAD_INPUT, "the working folder has been removed; change to one that is there"
    if error.errno == errno.ENOSPC:
        return FAILED, f"{where}the disk is full; free some space or choose another directory with --out"
    if error.errno in _NOT_THE_USERS_PATH or error.filename is None:
        return FAILED, f"{where}{reason}"
    return BAD_INPUT, f"{where}{reason}; check the path and its permissions"


def _has_working_folder() -> bool:
    try:
        return bool(os.getcwd())
    except OSError:
        return False


def in_one_line(sentence: str) -> str:
    """Return a sentence that may quote anything as one printable line, its middle left out where it is very long."""
    line = "".join(mark if mark.isprintable() else ascii(mark)[1:-1] for mark in " ".join(sentence.split()))
    if len(line) <= _LONGEST_LINE:
        return line
    return f"{line[: _LONGEST_LINE // 2]} ... {line[-_LONGEST_LINE // 2 :]}"
