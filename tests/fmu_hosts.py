"""Importers at hand, each run in a process of its own; see the scripts in `test_export/importers`."""

import ctypes
import json
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

SCRIPTS = Path(__file__).parent / "test_export" / "importers"
WITHIN_M = 1e-12


def _without(package: str) -> str:
    """Say why an importer cannot be used here; an empty text where it can."""
    if find_spec(package) is None:
        return f"{package} is not installed; it has binaries for x86-64 only"
    if package == "ecospy" and sys.platform == "linux":
        try:
            ctypes.CDLL("libtbb.so.12")
        except OSError:
            return "ecospy needs libtbb.so.12; on Debian: apt-get install libtbb12"
    return ""


IMPORTERS = [
    pytest.param(script, marks=pytest.mark.skipif(bool(_without(package)), reason=_without(package) or "-"))
    for script, package in (
        ("in_cosim.py", "libcosimpy"),
        ("in_ecos.py", "ecospy"),
        ("in_container.py", "fmu_manipulation_toolbox"),
    )
]


def hosted(script: str, job: dict[str, Any], folder: Path) -> list[float]:
    """Run a job in an importer; returns the displacements in m that it wrote."""
    (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
    words = [sys.executable, str(SCRIPTS / script), str(folder / "job.json"), str(folder / "found.json")]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=120, cwd=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads((folder / "found.json").read_text(encoding="utf-8"))


def stepped_in_child(fmus: Sequence[Path], steps: Sequence[tuple[float, float]]) -> list[list[list[float]]]:
    """Step FMUs side by side through FMPy in a child process: [fmu][step][output]."""
    job = json.dumps({"fmus": [str(path) for path in fmus], "steps": list(steps)})
    script = SCRIPTS.parent / "running_fmu.py"
    done = subprocess.run(
        [sys.executable, str(script)], input=job, capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def largest_difference(left: Sequence[float], right: Sequence[float]) -> float:
    return max(abs(a - b) for a, b in zip(left, right, strict=True))
