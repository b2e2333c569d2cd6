"""What the passes of `bender hil --learn` play, and what they are held against, without a bench."""

import argparse
from pathlib import Path

import numpy as np
import pytest

from bender_hil.bench_file import BenchFile, read_bench
from bender_hil.learning import learn_on_bench, read_at
from bender_hil.log.results import RECORD
from bender_loop.control.references import read_profile
from bender_loop.records.record import Record, write_record
from bender_loop.shell.files import prepare_directory

RATE_HZ, SCAN_S = 30.0, 5.0


def scan(time_s: np.ndarray) -> np.ndarray:
    return 8.0 * np.abs((time_s + 0.5) % 1.0 - 0.5)


@pytest.fixture
def bench(tmp_path: Path) -> BenchFile:
    (tmp_path / "bench.toml").write_text('[emulator]\nmodel = "bench"\n')
    return read_bench(tmp_path / "bench.toml")


def learned(tmp_path: Path, bench: BenchFile) -> list[tuple[np.ndarray, np.ndarray]]:
    """Learn a scan whose file rounds its times; each pass: frames at odd times, and what the tip did, which is what
    was asked of it.
    """
    time_s = np.arange(round(SCAN_S * RATE_HZ)) / RATE_HZ
    lines = [f"{t:.7g},{x!r}\n" for t, x in zip(time_s, scan(time_s).tolist(), strict=True)]
    (tmp_path / "scan.csv").write_text("time_s,setpoint_um\n" + "".join(lines))
    played, rng = [], np.random.default_rng(5)

    def run_pass(arguments: argparse.Namespace) -> int:
        target = read_profile(Path(arguments.profile))
        frames_s = time_s + rng.uniform(0.0, 0.2 / RATE_HZ, time_s.size)
        tip_um = target.sample(frames_s)
        write_record(prepare_directory(arguments.out) / RECORD, Record(frames_s - frames_s[0], 0.0 * frames_s, tip_um))
        played.append((frames_s, tip_um))
        return 0

    words = {"learn": 2, "profile": tmp_path / "scan.csv", "out": tmp_path / "passes"}
    assert learn_on_bench(argparse.Namespace(**words), bench, run_pass) == 0
    return played


def test_a_target_runs_straight_through_the_set_points_whenever_frames_come(tmp_path: Path, bench: BenchFile):
    frames_s, tip_um = learned(tmp_path, bench)[0]
    # 8 µm/s; a target held from frame to frame is off by 0.27 µm, one in eight parts by 0.03
    assert np.abs(tip_um - scan(frames_s)).max() < 0.06


def test_the_set_points_that_count_are_those_of_the_file(tmp_path: Path, bench: BenchFile):
    learned(tmp_path, bench)
    lines = np.loadtxt(tmp_path / "passes" / "learned.csv", delimiter=",", skiprows=1)
    at_samples = lines[::8]
    assert at_samples[:, 2] == pytest.approx(scan(at_samples[:, 0]), abs=1e-5)


def test_a_corner_between_two_frames_is_no_error():
    grid_s = np.arange(150) / RATE_HZ
    frames_s = grid_s + np.random.default_rng(7).uniform(0.0, 0.2 / RATE_HZ, grid_s.size)
    record = Record(frames_s, np.zeros(150), scan(frames_s))
    # on straight lines between the frames the readings miss up to 0.08 µm where the scan turns
    assert read_at(record, grid_s, scan(grid_s))[1:-1] == pytest.approx(scan(grid_s)[1:-1], abs=1e-9)
