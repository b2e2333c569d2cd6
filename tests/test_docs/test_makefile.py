"""`make clean` takes what can be made again, and leaves what was measured on a bench."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def outside_of_make() -> dict[str, str]:
    """The environment without what a make that runs the tests hands on: its VENV is the one the tests run in."""
    return {
        name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "VENV")
    }


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
@pytest.mark.parametrize("has_runs", [False, True])
def test_clean_keeps_runs_on_a_bench(has_runs: bool, tmp_path: Path) -> None:
    shutil.copyfile(ROOT / "Makefile", tmp_path / "Makefile")
    kept = tmp_path / "results" / "hil-20260101-120000" / "record.csv"
    gone = tmp_path / "results" / "demo" / "index.html"
    for path in (gone, *([kept] if has_runs else [])):
        path.parent.mkdir(parents=True)
        path.write_text("x", encoding="utf-8")
    for _ in range(2):
        words = ["make", "clean", "VENV=.venv"]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False, env=outside_of_make())
        assert done.returncode == 0, done.stderr
    assert kept.exists() is has_runs
    assert not gone.parent.exists()
    assert (tmp_path / "results").exists() is has_runs
