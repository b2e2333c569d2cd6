"""What the kernel's table says of processes. POSIX only, with /proc."""

import contextlib
from pathlib import Path


def children_of(pid: int) -> list[int]:
    """Return whom a process has started and not outlived."""
    with contextlib.suppress(OSError):
        return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return []


def words_of(pid: int) -> bytes:
    """Return the command line, each word ended by a zero."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    return b""


def _state(pid: int) -> str:
    """The letter of the process in the kernel's table, empty for none."""
    with contextlib.suppress(OSError, IndexError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    return ""


def is_stopped(pid: int) -> bool:
    return _state(pid) in ("T", "t")


def is_there(pid: int) -> bool:
    """Whether it is at work or stopped."""
    return _state(pid) not in ("", "Z", "X")
