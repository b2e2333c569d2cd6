"""`make clean` takes what can be made again, and leaves what was measured on a bench."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")


def clean(folder: Path) -> None:
    """Run `make clean` without what a make that runs the tests hands on: its VENV is the one the tests run in."""
    shutil.copyfile(ROOT / "Makefile", folder / "Makefile")
    outside = {k: x for k, x in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "VENV")}
    words = ["make", "clean", "VENV=.venv"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False, env=outside)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("has_runs", [False, True])
def test_clean_keeps_runs_on_a_bench(has_runs: bool, tmp_path: Path) -> None:
    kept = tmp_path / "results" / "hil-20260101-120000" / "record.csv"
    gone = tmp_path / "results" / "demo" / "index.html"
    for path in (gone, *([kept] if has_runs else [])):
        path.parent.mkdir(parents=True)
        path.write_text("x", encoding="utf-8")
    for _ in range(2):
        clean(tmp_path)
    assert kept.exists() is has_runs
    assert not gone.parent.exists()
    assert (tmp_path / "results").exists() is has_runs


@pytest.mark.parametrize("journal", ["run.jsonl", "guard.jsonl", "journal.jsonl"])
def test_clean_keeps_what_a_run_with_a_folder_of_its_own_has_left(journal: str, tmp_path: Path) -> None:
    results = tmp_path / "results"
    kept, gone = results / "step" / "first" / journal, results / "demo" / "bench" / journal
    tuned = results / "tune-1" / "gains.toml"
    for path, text in ((kept, '{"emulated": false}'), (gone, '{"emulated": true}'), (tuned, "kp = 1.0")):
        path.parent.mkdir(parents=True)
        path.write_text(text, encoding="utf-8")
    clean(tmp_path)
    assert kept.exists()
    assert not gone.exists()
    assert not tuned.exists()
