"""What every test shares: no display, and hypothesis without deadlines (reproducible where CI is set)."""

import atexit
import os
import shutil
import signal
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "Agg")
# FMUs of one run bear one date, so that their bytes can be compared
os.environ.setdefault("SOURCE_DATE_EPOCH", "1767225600")

# the tests start hundreds of processes, and without bytecode each of them compiles anew what it imports, which takes
# longer than what it does: where none is to be written into the checkout, all of a run share a folder elsewhere
if sys.dont_write_bytecode and not sys.pycache_prefix:
    sys.dont_write_bytecode, sys.pycache_prefix = False, tempfile.mkdtemp(prefix="bender-bytecode-")
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix

    def _without_bytecode(folder: str, owner: int) -> None:
        if os.getpid() == owner:
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(_without_bytecode, sys.pycache_prefix, os.getpid())

# a run on the bench tells a second one on the same machine, by a lock in the folder for temporary files: workers that
# test at the same time have one each
if worker := os.environ.get("PYTEST_XDIST_WORKER"):
    folder = Path(tempfile.gettempdir()) / f"bender-{worker}"
    folder.mkdir(exist_ok=True)
    os.environ["TMPDIR"] = str(folder)
    tempfile.tempdir = None

import pytest
from hypothesis import settings

# enough to meet what a law forbids again and again over the runs; `make test-all` looks longer
settings.register_profile("default", deadline=None, max_examples=20)
settings.register_profile("ci", deadline=None, max_examples=20, derandomize=True)
settings.register_profile("thorough", deadline=None, max_examples=200)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE") or ("ci" if os.environ.get("CI") else "default"))

# a shell that starts the tests in the background has them ignore Ctrl-C, and so would the children that tests interrupt
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# the same for a closed terminal, after nohup
if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Trials run only where they are asked for."""
    if "trial" not in str(config.getoption("markexpr")):
        trials = [x for x in items if x.get_closest_marker("trial")]
        items[:] = [x for x in items if x not in trials]
        config.hook.pytest_deselected(items=trials)
