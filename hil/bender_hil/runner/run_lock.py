"""Who else runs a bench on this machine: locks that the operating system takes back when a process ends.

Two runs at once share two cores and one disk, so the second is told. Two runs on one supply would fight over the
output, so the second is refused.

The locks lie in a folder of this user alone. A folder of that name that somebody else has made, or may write to, is
not used: a link that waits in it would have another file written over.
"""

import contextlib
import getpass
import hashlib
import os
import re
import stat
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

from bender_loop.errors import InputError
from bender_loop.shell.cache import NAME
from bender_loop.shell.file_lock import locked

_WORDS_AT = 1
"""The first byte is what is locked; on Windows a locked byte cannot be read by others."""


@contextlib.contextmanager
def sole_run(resource: str | None, out: Path) -> Iterator[str | None]:
    """Hold the locks of a run while the context lasts; gives who else runs a bench here, None for nobody.

    A machine on which no locks can be made is used without them.

    Args:
        resource: address of the supply, None for an emulated bench.
        out: directory of the run, for what others are told.

    Raises:
        InputError: another run drives that supply.
    """
    with contextlib.ExitStack() as ends:
        if resource is not None:
            name = hashlib.sha256(_canonical(resource).encode("utf-8", "surrogateescape")).hexdigest()[:16]
            who = _take(ends, f"supply-{name}", out)
            if who is not None:
                raise InputError(f"{resource}: another run drives this source ({who}); wait for its end, or stop it")
        yield _take(ends, "run", out)


@contextlib.contextmanager
def sole_run_with_note(resource: str | None, out: Path, tell: Callable[[str], None]) -> Iterator[None]:
    """Hold the locks of a run as `sole_run` does; tell, in one sentence, who else runs a bench here.

    Raises:
        InputError: another run drives that supply.
    """
    with sole_run(resource, out) as other:
        if other is not None:
            tell(f"note: another run is active on this machine ({other}); both may run late")
        yield


def _canonical(resource: str) -> str:
    """Return a VISA address as any other spelling of it: capitals do not count, nor a 0 for the first board."""
    return re.sub(r"^(TCPIP|USB|GPIB|PXI|VXI)0?::", r"\1::", resource.strip().upper())


def _take(ends: contextlib.ExitStack, name: str, out: Path) -> str | None:
    """Take a lock until the stack is closed; returns who has it when it is taken."""
    file = next((file for folder in _folders() if (file := _opened(folder, f"{name}.lock")) is not None), None)
    if file is None:
        return None
    ends.enter_context(file)
    if not locked(file):
        file.seek(_WORDS_AT)
        return file.read(400).decode("utf-8", "replace").strip() or "its process is unknown"
    with contextlib.suppress(OSError):
        file.truncate(0)
        file.write(f" process {os.getpid()}, {out.absolute()}".encode("utf-8", "surrogateescape"))
    return None


def _folders() -> Iterator[Path]:
    """Yield where the locks may lie, the usual place first."""
    yield Path(tempfile.gettempdir()) / f"bender-hil-{_user()}"
    from platformdirs import user_state_path

    yield user_state_path(NAME) / "locks"


def _opened(folder: Path, name: str) -> BinaryIO | None:
    """Open a lock, made where it is missing; None where the folder or the file is not this user's alone."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not _is_ours(folder.lstat(), stat.S_ISDIR):
            return None
        number = os.open(folder / name, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    except OSError:
        return None
    file = os.fdopen(number, "r+b", buffering=0)
    if not _is_ours(os.fstat(number), stat.S_ISREG):
        file.close()
        return None
    return file


def _is_ours(found: os.stat_result, is_kind: Callable[[int], bool]) -> bool:
    """Whether it is of that kind, of this user, and nobody else may write to it."""
    if not is_kind(found.st_mode):
        return False
    return not hasattr(os, "getuid") or (found.st_uid == os.getuid() and not found.st_mode & 0o022)


def _user() -> str:
    try:
        return str(os.getuid()) if hasattr(os, "getuid") else getpass.getuser()
    except (OSError, KeyError):
        return "everybody"
