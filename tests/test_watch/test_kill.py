"""A watch whose process is killed goes on where it was: nothing is said twice, and no row is left out."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bender_compiled.simulation import Drive, Simulator
from bender_loop.records.record import Record, write_record
from bender_plant.model import load_model
from bender_watch.session import EVENTS, STATE

ROWS = 12_000
OFTEN = """
import sys
import bender_watch.follow.growing as growing
import bender_watch.session as session
growing.BYTES_AT_ONCE, session.SAVED_EVERY_S = 30_000, 0.0
from bender_cli.main import main
sys.exit(main(sys.argv[1:]))
"""
"""The command, that keeps its state behind every few hundred rows."""


def recorded(seed: int, rows: int) -> Record:
    """Return steps at 50 Hz with lost readings, missing rows and a pause; the gain fades from a fourth on."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(rows) / 50.0
    voltage = np.repeat(np.append(0.0, rng.uniform(0.0, 30.0, rows // 20)), 20)[:rows]
    reading = Simulator(Drive.of_rows(time_s, voltage)).run(load_model("beam")).reading_um
    reading = reading * (1.0 - 0.06 * np.maximum(np.arange(rows) / rows - 0.25, 0.0)) + 0.05 * rng.standard_normal(rows)
    reading[rng.random(rows) < 0.01] = np.nan
    kept = np.ones(rows, bool)
    for begin, length in ((rows // 5, 3), (rows // 2, 40), (2 * rows // 3, 700)):
        kept[begin : begin + length] = False
    return Record(time_s[kept], voltage[kept], reading[kept])


def command(folder: Path, out: str) -> list[str]:
    own = ["watch", "beam", str(folder / "own.csv"), "--training", str(folder / "training.csv")]
    return [sys.executable, "-c", OFTEN, *own, "--replay", "--no-diagnosis", "--quiet", "--out", str(folder / out)]


def events(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(x) for x in (folder / EVENTS).read_text(encoding="utf-8").splitlines()]


def states(path: Path, process: subprocess.Popen[bytes]) -> Iterator[int]:
    """Yield how many states have been kept, whenever there is another one, while a process lives."""
    found, last = 0, path.stat().st_mtime_ns if path.exists() else 0
    while process.poll() is None:
        now = path.stat().st_mtime_ns if path.exists() else last
        if now != last:
            found, last = found + 1, now
            yield found
        time.sleep(0.002)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_a_watch_that_is_killed_again_and_again_says_what_one_says_that_is_not(tmp_path: Path) -> None:
    write_record(tmp_path / "training.csv", replace(recorded(1, 2000), displacement_um=still(1, 2000)))
    write_record(tmp_path / "own.csv", recorded(2, ROWS))
    whole = subprocess.run(command(tmp_path, "whole"), check=False, capture_output=True, timeout=600)
    assert whole.returncode == 3, whole.stderr
    for most in (1, 5):
        process = subprocess.Popen(command(tmp_path, "killed"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for kept in states(tmp_path / "killed" / STATE, process):
            if kept >= most:
                process.send_signal(signal.SIGKILL)
                break
        assert process.wait(600) == -signal.SIGKILL
    last = subprocess.run(command(tmp_path, "killed"), check=False, capture_output=True, timeout=600)
    assert last.returncode == 3, last.stderr
    assert events(tmp_path / "killed") == events(tmp_path / "whole")
    one, other = (json.loads((tmp_path / x / "watch.json").read_text("utf-8")) for x in ("killed", "whole"))
    assert all(one[x] == other[x] for x in ("rows", "judged", "lost", "alarms", "trends", "baseline"))
    said = [x["event"] for x in events(tmp_path / "whole")]
    assert 1 <= said.count("alarm") <= 3
    assert "trend" in said


def still(seed: int, rows: int) -> np.ndarray:
    """Return the readings of the same commands while all was well."""
    record = recorded(seed, rows)
    reading = Simulator(Drive.of_rows(record.time_s, record.voltage_V)).run(load_model("beam")).reading_um
    return reading + 0.05 * np.random.default_rng(seed).standard_normal(reading.size)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_what_is_missing_is_no_alarm(seed: int, tmp_path: Path) -> None:
    """Lost readings, missing rows and a pause, in training and behind it; the command before them holds."""
    for name, own in (("training", 10 + seed), ("own", 20 + seed)):
        rows = 2000 if name == "training" else ROWS
        record = recorded(own, rows)
        lost = np.isnan(record.displacement_um)
        readings = np.where(lost, np.nan, still(own, rows))
        write_record(tmp_path / f"{name}.csv", replace(record, displacement_um=readings))
    found = subprocess.run(command(tmp_path, "out"), check=False, capture_output=True, timeout=600)
    assert found.returncode == 0, found.stdout
