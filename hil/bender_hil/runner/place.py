"""The directory of a run: never one that holds a run already, and as if never touched when the input was bad."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from bender_hil.log.read_run import GUARD, RUN
from bender_loop.errors import InputError
from bender_loop.shell.files import prepare_directory


@contextlib.contextmanager
def run_directory(out: Path) -> Iterator[Path]:
    """Make the directory; an InputError in the context takes back what was made.

    Raises:
        InputError: there is a run already, or the directory cannot be made.
    """
    if (out / RUN).exists():
        raise InputError(f"{out}: there is a run already; choose another directory with --out")
    made = [path for path in (out, *out.parents) if not path.exists()]
    prepare_directory(out)
    try:
        yield out
    except InputError:
        for name in (RUN, GUARD):
            (out / name).unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            for path in made:
                path.rmdir()
        raise
