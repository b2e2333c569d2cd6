"""The guard as a process: what ends a run, and that the output is off afterwards. Nothing is timed here."""

import contextlib
import itertools
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from emulated_bench import QUICK, assert_off, drive, orders, wait_until_off
from few import few, few_rows

from bender_emulator.start import EmulatedSupply
from bender_hil.guard.guard import Status
from bender_hil.guard.settings import GuardSettings
from bender_hil.guard.start import GuardProcess
from bender_hil.log.journal import read_journal
from bender_loop.shell.messages import ClosedError

pytest.importorskip("pyvisa_py")

CONTROLLER = """
import sys, time
from bender_hil.guard.settings import GuardOrders
from bender_hil.guard.start import GuardProcess
guard = GuardProcess(GuardOrders.from_json(sys.stdin.readline()))
for tick in range(100000):
    level = min(30.0, 3.0 * tick)
    guard.command(tick, level, time.perf_counter(), 0.4 * level)
    if tick == 15:
        print("up", flush=True)
        exec(sys.argv[1])
    time.sleep(0.02)
"""


def _entries(folder: Path, kind: str) -> list[dict[str, object]]:
    return [entry for entry in read_journal(folder / "guard.jsonl") if entry["kind"] == kind]


def test_a_run_that_is_done_ends_at_zero_with_the_output_off(supply: EmulatedSupply, tmp_path: Path):
    guard = GuardProcess(orders(supply.resource, tmp_path))
    assert guard.ready["emulated"]
    truth = supply.truth()
    assert (truth["limit_A"], truth["upper_V"], truth["protection_V"]) == (0.01, 50.0, 55.0)
    assert truth["protection_on"]
    drive(guard, 15)
    guard.stop()
    ended = guard.wait()
    assert (ended.status, ended.code, ended.alarm) == (Status.DONE, None, "")
    assert_off(supply)
    assert not supply.truth()["is_remote"]
    (harmless,) = _entries(tmp_path, "harmless")
    assert isinstance(harmless["measured_V"], float)
    assert harmless["measured_V"] < 1.0
    applied = [entry["voltage_V"] for entry in _entries(tmp_path, "applied")]
    assert max(applied) == 30.0  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("what", "code"),
    few_rows(
        [
            ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "controller_gone"),
            ("os = __import__('os'); os.kill(os.getpid(), __import__('signal').SIGSTOP)", "heartbeat"),
            ("raise ZeroDivisionError", "controller_gone"),
            ("time.sleep(60)", "heartbeat"),
            ("guard._channel.send({'do': 'command', 'voltage_V': '30'})", "bad_command"),
            ("guard._channel.send({'do': 'dance'})", "bad_command"),
            ("guard._channel._stream.sendall(b'nonsense\\n')", "controller_gone"),
            ("guard.trip('camera_stalled', 'no frame')", "camera_stalled"),
            ("guard.process.terminate()", "signal"),
            ("guard.process.send_signal(2)", "signal"),
        ],
        0,
        1,
        5,
        7,
        8,
    ),
)
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_whatever_becomes_of_the_controller_the_output_goes_off(
    supply: EmulatedSupply, tmp_path: Path, what: str, code: str
):
    limits = replace(QUICK, heartbeat_s=0.4) if code == "heartbeat" else QUICK
    child = subprocess.Popen(
        [sys.executable, "-c", CONTROLLER, what],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    try:
        assert child.stdin is not None
        assert child.stdout is not None
        child.stdin.write(orders(supply.resource, tmp_path, limits).to_json() + "\n")
        child.stdin.flush()
        assert child.stdout.readline() == "up\n"
        wait_until_off(supply)
        end_s = time.perf_counter() + 5.0
        while not _entries(tmp_path, "end") and time.perf_counter() < end_s:
            time.sleep(0.02)
    finally:
        child.kill()
        child.wait()
        child.communicate()
    assert_off(supply)
    (end,) = _entries(tmp_path, "end")
    assert (end["code"], end["confirmed"], end["status"]) == (code, True, 1)


def test_a_guard_that_is_killed_is_replaced_by_one_that_makes_safe(supply: EmulatedSupply, tmp_path: Path):
    guard = GuardProcess(orders(supply.resource, tmp_path))
    drive(guard, 12)
    assert supply.truth()["is_on"]
    guard.process.kill()
    with pytest.raises(ClosedError):
        _keep_asking(guard)
    ended = guard.wait()
    assert (ended.status, ended.code, ended.alarm) == (Status.TRIPPED, "guard_gone", "")
    assert_off(supply)


@pytest.mark.skipif(os.name == "nt", reason="SIGSTOP")
def test_a_guard_that_hangs_is_replaced_too(supply: EmulatedSupply, tmp_path: Path):
    guard = GuardProcess(orders(supply.resource, tmp_path))
    drive(guard, 12)
    guard.process.send_signal(signal.SIGSTOP)
    with pytest.raises(ClosedError, match="silent"):
        _keep_asking(guard)
    ended = guard.wait()
    assert (ended.status, ended.code, ended.alarm) == (Status.TRIPPED, "guard_gone", "")
    assert_off(supply)


def _keep_asking(guard: GuardProcess) -> None:
    for _ in range(500):
        guard.beat()
        if guard.has_tripped():
            raise ClosedError("it has tripped")
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("limits", "tip", "code"),
    [
        (replace(QUICK, travel_um=(-1.0, 5.0)), None, "travel"),
        (replace(QUICK, frame_age_s=0.02), 0.0, "frame_age"),
    ],
)
def test_the_guard_judges_by_itself(
    supply: EmulatedSupply, tmp_path: Path, limits: GuardSettings, tip: float | None, code: str
):
    guard = GuardProcess(orders(supply.resource, tmp_path, limits))
    if code == "frame_age":
        guard.command(0, 3.0, time.perf_counter(), 0.0)
        with contextlib.suppress(ClosedError):
            _keep_asking(guard)
    else:
        drive(guard, 30, tip=tip)
    ended = guard.wait()
    assert (ended.status, ended.code) == (Status.TRIPPED, code)
    assert_off(supply)


def test_a_lost_tip_is_borne_for_a_while(supply: EmulatedSupply, tmp_path: Path):
    guard = GuardProcess(orders(supply.resource, tmp_path))
    for tick, tip_um in enumerate([0.0, None, None, 0.1, None, None, 0.2]):
        guard.command(tick, 1.0, time.perf_counter(), tip_um)
        time.sleep(0.02)
    assert not guard.has_tripped()
    for tick in range(7, 10):
        guard.command(tick, 1.0, time.perf_counter(), None)
        time.sleep(0.02)
    assert guard.wait().code == "lost_tip"
    assert_off(supply)


def test_commands_beyond_the_limits_are_clamped_and_counted(supply: EmulatedSupply, tmp_path: Path):
    guard = GuardProcess(orders(supply.resource, tmp_path, replace(QUICK, maximum_V=10.0, protection_V=12.0)))
    for tick, wanted_V in enumerate([-3.0, 5.0, 10.5, 1e9]):
        guard.command(tick, wanted_V, time.perf_counter(), 0.0)
        _wait_until_applied(tmp_path, tick)
    guard.stop()
    ended = guard.wait()
    assert ended.facts["clamped"] == 3
    assert [entry["clamped_V"] for entry in _entries(tmp_path, "clamped")] == [0.0, 10.0, 10.0]
    assert max(entry["voltage_V"] for entry in _entries(tmp_path, "applied")) == 10.0  # pyright: ignore


def _wait_until_applied(folder: Path, sequence: int) -> None:
    end_s = time.perf_counter() + 0.9
    while time.perf_counter() < end_s:
        if any(entry["sequence"] == sequence for entry in _entries(folder, "applied")):
            return
        time.sleep(0.01)


def test_a_jump_is_led_by_the_slew_limit(supply: EmulatedSupply, tmp_path: Path):
    limits = replace(QUICK, slew_V_per_s=100.0, burst_s=0.05, settle_s=0.5)
    guard = GuardProcess(orders(supply.resource, tmp_path, limits))
    for _ in range(25):
        guard.command(0, 30.0, time.perf_counter(), 0.0)
        time.sleep(0.02)
    guard.stop()
    assert guard.wait().facts["slowed"] > 0
    steps = [(entry["command_time_s"], entry["voltage_V"]) for entry in _entries(tmp_path, "applied")]
    assert steps[-1][1] == 30.0
    for (before_s, before_V), (after_s, after_V) in itertools.pairwise(steps):
        assert after_V - before_V <= 100.0 * (after_s - before_s + 0.05) + 1e-2  # pyright: ignore


@pytest.mark.slow
def test_the_journal_is_lines_of_json_without_gaps(supply: EmulatedSupply, tmp_path: Path):
    guard = GuardProcess(orders(supply.resource, tmp_path))
    drive(guard, 5)
    guard.process.send_signal(signal.SIGTERM)
    guard.wait()
    lines = (tmp_path / "guard.jsonl").read_text().splitlines()
    assert [json.loads(line)["n"] for line in lines] == list(range(len(lines)))


@pytest.mark.parametrize("name", few(["statistics", "random", "secrets"], 0))
def test_the_guard_runs_no_module_of_the_working_folder(
    supply: EmulatedSupply, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
):
    (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'was_run')!r}, 'w').close(); raise SystemExit(5)")
    monkeypatch.chdir(tmp_path)
    guard = GuardProcess(orders(supply.resource, tmp_path))
    guard.stop()
    assert guard.wait().status is Status.DONE
    assert not (tmp_path / "was_run").exists()
