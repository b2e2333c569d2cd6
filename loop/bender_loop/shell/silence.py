"""Libraries of C and Fortran write to the streams of the process, past Python: what they say is held back here."""

import contextlib
import os
import sys
from collections.abc import Iterator

STANDARD_OUTPUT, STANDARD_ERROR = 1, 2


@contextlib.contextmanager
def silence_below_python(number: int) -> Iterator[None]:
    """Let what is written to a descriptor go nowhere while the context lasts, from every thread.

    Args:
        number: `STANDARD_OUTPUT` or `STANDARD_ERROR`; nothing happens with one that was closed.
    """
    try:
        (sys.stdout if number == STANDARD_OUTPUT else sys.stderr).flush()
        kept, nowhere = os.dup(number), os.open(os.devnull, os.O_WRONLY)
    except (AttributeError, OSError, ValueError):
        yield
        return
    os.dup2(nowhere, number)
    os.close(nowhere)
    try:
        yield
    finally:
        os.dup2(kept, number)
        os.close(kept)
