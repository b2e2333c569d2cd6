"""A lock on an open file, which the operating system takes back when its process ends."""

import os
from typing import BinaryIO


def locked(file: BinaryIO) -> bool:
    """Take the lock of a file until it is closed; return whether it could be had."""
    try:
        if os.name == "nt":
            import msvcrt

            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # pyright: ignore[reportAttributeAccessIssue]
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
