"""The directory of a run, and what the run was made with, for the first line of its journal.

Never a directory that holds a run already, and as if never touched when nothing was switched on.
"""

import contextlib
import hashlib
import platform
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from bender_hil.log.read_run import GUARD, RUN
from bender_loop.errors import InputError, RunError
from bender_loop.shell.files import prepare_directory

RESCUE = "rescue.jsonl"
_JOURNALS = (RUN, GUARD, RESCUE)
FOLLOWED, CONTROLLER = "followed_model.fmu", "controller.fmu"
"""The model that the controller of a run follows; anybody's controller."""
_PACKAGES = ("piezo-bender", "opencv-python-headless", "pyvisa", "pyvisa-py", "numpy", "fmpy")


class RunFolder:
    """A directory that a run writes to.

    Attributes:
        path: of the directory.
        is_ours: the journal of this run is in it, so that no other run can be.
        is_kept: the output may have been on: whatever happens from now on, nothing in it is deleted.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.is_ours = self.is_kept = False

    @contextlib.contextmanager
    def kept_unless_refused(self) -> Iterator[None]:
        """Arm the supply in this context: only an InputError says that nothing was switched on."""
        self.is_kept = True
        try:
            yield
        except InputError:
            self.is_kept = False
            raise


@contextlib.contextmanager
def run_directory(out: Path) -> Iterator[RunFolder]:
    """Make the directory; bad input or an interrupt in the context takes back what was made, unless it is kept.

    Raises:
        InputError: there is a run already, or the directory cannot be made.
        RunError: bad input or a failure of the disk was met after the output may have been on.
    """
    folder = RunFolder(out)
    if any((out / name).exists() for name in _JOURNALS):
        raise InputError(f"{out}: already holds a run; choose another directory with --out")
    made = [path for path in (out, *out.parents) if not path.exists()]
    try:
        prepare_directory(out)
        yield folder
    except (InputError, OSError, KeyboardInterrupt) as error:
        if not folder.is_kept:
            _take_back(folder, made)
        elif not isinstance(error, KeyboardInterrupt):
            raise RunError(f"{error}; the logs of the run are in {out}") from error
        raise


def _take_back(folder: RunFolder, made: list[Path]) -> None:
    with contextlib.suppress(OSError):
        for name in (*_JOURNALS, FOLLOWED, CONTROLLER) if folder.is_ours else ():
            (folder.path / name).unlink(missing_ok=True)
        # what an interrupt left of trying whether files can be made here
        for stray in folder.path.glob(".*.tmp") if folder.path in made else ():
            stray.unlink()
        for path in made:
            path.rmdir()


def plain(calibration: Any) -> dict[str, Any]:
    """Return a calibration as a table."""
    return {name: getattr(calibration, name) for name in calibration.__dataclass_fields__}


def versions() -> dict[str, str]:
    """Return the versions of Python, the system and the packages that a run rests on."""
    found = {"python": platform.python_version(), "system": platform.platform()}
    for package in _PACKAGES:
        with contextlib.suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def sha256(path: Path | None) -> str | None:
    """Return the hash of a file, None where there is none."""
    if path is None or not path.is_file():
        return None
    return hashlib.sha256(path.read_bytes()).hexdigest()
