"""The trial run from outside: the process that runs the FMU may crash or hang, this one does not."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

from bender_loop.errors import RunError
from bender_loop.fmu.check.explanations import explained_failure
from bender_loop.fmu.check.findings import LEAVING, Finding, error, one_line
from bender_loop.fmu.file import read_description

SECONDS = 60.0
_ASK = "ask the maker of the FMU"


def trial_findings(path: Path, seconds: float = SECONDS) -> Iterable[Finding]:
    """Run an FMU in a process of its own; a crash and a hang are findings."""
    found, fall = _run(path, seconds, "all")
    return [*found, fall] if fall is not None else found


def require_sound_start(path: Path, seconds: float = SECONDS) -> None:
    """Make sure that an FMU starts and steps without taking its host along, before this process becomes its host.

    Raises:
        InputError: it is no FMU for this platform.
        RunError: it crashed or hung in a process of its own; what it reports in an orderly way is left to the run.
    """
    read_description(path)
    _, fall = _run(path, seconds, "start")
    if fall is not None:
        raise RunError(f"{path}: {fall.what}; {fall.why}; {fall.remedy}")


def _run(path: Path, seconds: float, stages: str) -> tuple[list[Finding], Finding | None]:
    with tempfile.TemporaryDirectory(prefix="bender-trial-") as folder:
        result = Path(folder) / "result.json"
        words = [sys.executable, "-m", "bender_loop.fmu.check.trial", str(path.resolve()), str(result), stages]
        try:
            done = subprocess.run(words, capture_output=True, text=True, errors="replace", check=False, timeout=seconds)
        except subprocess.TimeoutExpired:
            done = None
        told = (
            json.loads(result.read_text(encoding="utf-8"))
            if result.exists()
            else {"stage": "the start", "findings": []}
        )
    found = [Finding(**finding) for finding in told["findings"]]
    if done is None:
        what = f"{told['stage']}: no end within {seconds:g} s"
        return found, error(what, "the FMU hangs, or is very slow", _ASK)
    if done.returncode == 0 and told["stage"] in (None, LEAVING):
        return found, None
    last = one_line(done.stderr.strip().rpartition("\n")[2]) if done.stderr.strip() else ""
    how = f"signal {-done.returncode}" if done.returncode < 0 else f"exit status {done.returncode}"
    what = f"{told['stage']}: the process that ran the FMU broke off with {how}" + (f" ({last})" if last else "")
    return found, explained_failure(what, "the FMU takes its host along", f"{_ASK}; run it in a process of its own")
