"""What every test shares: no display, and hypothesis without deadlines (reproducible where CI is set)."""

import os
import signal
import tempfile
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "Agg")

# a run on the bench tells a second one on the same machine, by a lock in the folder for temporary files: workers that
# test at the same time have one each
if worker := os.environ.get("PYTEST_XDIST_WORKER"):
    folder = Path(tempfile.gettempdir()) / f"bender-{worker}"
    folder.mkdir(exist_ok=True)
    os.environ["TMPDIR"] = str(folder)
    tempfile.tempdir = None

from hypothesis import settings

# enough to meet what a law forbids again and again over the runs; `make test-all` looks longer
settings.register_profile("default", deadline=None, max_examples=30)
settings.register_profile("ci", deadline=None, max_examples=30, derandomize=True)
settings.register_profile("thorough", deadline=None, max_examples=200)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE") or ("ci" if os.environ.get("CI") else "default"))

# a shell that starts the tests in the background has them ignore Ctrl-C, and so would the children that tests interrupt
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# the same for a closed terminal, after nohup
if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
