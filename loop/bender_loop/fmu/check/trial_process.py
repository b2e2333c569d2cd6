"""The trial run from outside: the process that runs the FMU may crash or hang, this one does not."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

from bender_loop.fmu.check.explanations import explained_failure
from bender_loop.fmu.check.findings import LEAVING, Finding, error, one_line, warning

SECONDS = 60.0
_ASK = "ask the maker of the FMU"


def trial_findings(path: Path, seconds: float = SECONDS) -> Iterable[Finding]:
    """Run an FMU in a process of its own; a crash and a hang are findings.

    A process that breaks off while it ends, after all results are there, is a warning: a library of PythonFMU up to
    0.7 lets go of its interpreter twice, which now and then aborts the process.
    """
    found, fall = _run(path, seconds)
    return [*found, fall] if fall is not None else found


def _run(path: Path, seconds: float) -> tuple[list[Finding], Finding | None]:
    with tempfile.TemporaryDirectory(prefix="bender-trial-") as folder:
        result = Path(folder) / "result.json"
        words = [sys.executable, "-P", "-m", "bender_loop.fmu.check.trial", str(path.resolve()), str(result)]
        try:
            # what the FMU is unpacked to goes with the folder, however the process ends
            there = os.environ | dict.fromkeys(("TMPDIR", "TMP", "TEMP"), folder)
            done = subprocess.run(
                words, capture_output=True, text=True, errors="replace", check=False, timeout=seconds, env=there
            )
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
    if told["stage"] == LEAVING:
        return found, warning(
            what,
            "all results were there; but a host that loads the FMU may end with an error",
            f"{_ASK}, or run it in a process of its own; PythonFMU up to 0.7 does this now and then",
        )
    return found, explained_failure(what, "the FMU takes its host along", f"{_ASK}; run it in a process of its own")
