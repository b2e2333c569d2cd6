"""A disk that is full, a folder that goes: the run comes down, its logs stay, and the end is told as it is.

A small file system of its own is filled, or the folder of the run is removed, at every phase of a run on an emulated
bench that is driven as hardware is. Once the output has been on, the status is never that of bad input.
"""

import contextlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from emulated_bench import write_as_hardware

from bender_cli.main import main
from bender_emulator.microscope.control import set_fault
from bender_hil.emulated import EmulatedBench
from bender_hil.log import results
from bender_hil.log.journal import read_journal
from bender_hil.runner import run as runner
from bender_loop.records.record import read_record
from bender_loop.shell.last_word import UNKNOWN

pytest.importorskip("pyvisa_py")
pytest.importorskip("cv2")
pytestmark = pytest.mark.slow

PHASES = ("armed", "first tick", "running", "off")
PATIENT = "[guard]\nheartbeat_s = 1.0\nframe_age_s = 1.0\nshutdown_limit_s = 2.0\n"
Break = Callable[[Path], object]


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of half a megabyte."""
    place = tmp_path / "disk"
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=512k", "tmpfs", str(place)]
    try:
        done = subprocess.run(command, capture_output=True, check=False).returncode == 0
    except OSError:
        done = False
    if not done:
        pytest.skip("no small file system can be mounted here (needs Linux and root)")
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


def fill(out: Path) -> None:
    """Leave not one byte free where the run writes."""
    with contextlib.suppress(OSError), (out.parent / "filler").open("ab", buffering=0) as file:
        for size in (4096, 1):
            with contextlib.suppress(OSError):
                while True:
                    file.write(b"x" * size)


def remove(out: Path) -> None:
    """Remove the folder of the run, whatever is written into it meanwhile."""
    end_s = time.perf_counter() + 1.0
    while out.exists() and time.perf_counter() < end_s:
        shutil.rmtree(out, ignore_errors=True)


def take_frames(out: Path) -> None:
    """Put a file where the folder of the frames belongs."""
    (out / "frames").write_text("taken")


def _run(
    bench: EmulatedBench, out: Path, monkeypatch: pytest.MonkeyPatch, breaks: Break, phase: str, trip: bool = False
) -> int:
    """`bender hil` with the break at that phase; a trip is made by the lamp that goes out."""
    file, seen = write_as_hardware(out.parent.parent / "files", bench, PATIENT), 0

    def now(name: str) -> None:
        if name == phase:
            breaks(out)

    def look_on(_: object) -> None:
        nonlocal seen
        seen += 1
        if trip and seen == 20:
            set_fault(bench.control_port, "black")
        now({1: "first tick", 15: "running"}.get(seen, ""))

    plain = runner.run

    def watched(*arguments: object, **settings: object) -> runner.RunResult:
        hooks = {"witness": look_on, "started": lambda _: now("armed"), "finished": lambda: now("off")}
        return plain(*arguments, **{**settings, **hooks})  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(runner, "run", watched)
    return main(["hil", "--bench", str(file), "--setpoint", "5", "--duration", "1", "--out", str(out)])


@pytest.mark.parametrize("trip", [False, True], ids=["planned", "tripped"])
@pytest.mark.parametrize("phase", PHASES)
def test_a_disk_that_is_full_at_any_moment(
    bench: EmulatedBench, small_disk: Path, monkeypatch: pytest.MonkeyPatch, capfd, phase: str, trip: bool
):
    out = small_disk / "run"
    assert _run(bench, out, monkeypatch, fill, phase, trip) == 1
    err = capfd.readouterr().err
    assert "No space left" in err or "disk is full" in err
    assert not bench.supply.truth()["is_on"]
    entries = list(read_journal(out / "run.jsonl"))
    assert [entry["kind"] for entry in entries[:2]] == ["start", "ready"]
    guard = list(read_journal(out / "guard.jsonl"))
    assert guard[0]["kind"] == "opened"
    if phase in ("running", "off"):
        assert sum(entry["kind"] == "tick" for entry in entries) >= 14
    # what is written beside the logs is whole or not there
    names = {path.name for path in out.iterdir()}
    assert not [name for name in names if name.endswith(".tmp")]
    if "record.csv" in names:
        read_record(out / "record.csv")


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.skipif(os.name == "nt", reason="open files cannot be removed")
def test_a_folder_that_is_removed_at_any_moment(
    bench: EmulatedBench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd, phase: str
):
    out = tmp_path / "place" / "run"
    assert _run(bench, out, monkeypatch, remove, phase) == 1
    captured = capfd.readouterr()
    assert "removed" in captured.err or "cannot be read" in captured.err or "cannot be written" in captured.err
    assert "record.csv" not in captured.out
    assert not bench.supply.truth()["is_on"]


def test_a_file_where_the_frames_belong(bench: EmulatedBench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd):
    out = tmp_path / "place" / "run"
    assert _run(bench, out, monkeypatch, take_frames, "running", trip=True) == 1
    assert "frames" in capfd.readouterr().err
    assert list(read_journal(out / "run.jsonl"))[-1]["kind"] == "stop"
    assert list(read_journal(out / "guard.jsonl"))[-1]["kind"] == "end"
    assert (out / "record.csv").exists()


def test_no_room_from_the_start_is_a_failure_before_anything_is_on(
    bench: EmulatedBench, small_disk: Path, monkeypatch: pytest.MonkeyPatch, capfd
):
    fill(small_disk / "run")
    assert _run(bench, small_disk / "run", monkeypatch, fill, "never") in (1, 2)
    said = [x for x in capfd.readouterr().err.splitlines() if not x.startswith("note: ")]
    assert len(said) == 1
    assert not (small_disk / "run").exists()


def no_memory(*_: object) -> None:
    raise MemoryError


SECOND_TROUBLES: dict[str, Break] = {
    "none": lambda _: None,
    "record is a folder": lambda out: (out / "record.csv").mkdir(),
    "folder renamed": lambda out: out.rename(out.with_name("moved")),
    "folder removed": remove,
    "journal garbled": lambda out: (out / "run.jsonl").write_text("garbled\n"),
    "frames taken": take_frames,
}


@pytest.mark.skipif(os.name == "nt", reason="open files cannot be moved")
@pytest.mark.parametrize("trouble", [*SECOND_TROUBLES, "no memory"])
def test_an_alarm_outlives_a_second_trouble(
    bench: EmulatedBench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd, trouble: str
):
    def breaks(out: Path) -> None:
        bench.supply.fault("stuck_on")
        SECOND_TROUBLES.get(trouble, lambda _: None)(out)

    if trouble == "no memory":
        monkeypatch.setattr(results, "page", no_memory)
    assert _run(bench, tmp_path / "place" / "run", monkeypatch, breaks, "first tick") == 3
    assert bench.supply.truth()["is_on"]
    captured = capfd.readouterr()
    assert UNKNOWN in captured.err.splitlines()[-1]
    assert "output is off" not in captured.out + captured.err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_a_full_standard_output_does_not_hide_the_run(tmp_path: Path):
    (tmp_path / "bench.toml").write_text(f"[emulator]\n{PATIENT}")
    words = [sys.executable, "-m", "bender_hil", "--bench", "bench.toml", "--duration", "0.5", "--out", "run"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            words, cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False
        )
    assert done.returncode == 1
    assert "cannot be printed" in done.stderr.splitlines()[-1]
    assert (tmp_path / "run" / "record.csv").exists()
    assert (tmp_path / "run" / "summary.json").exists()
