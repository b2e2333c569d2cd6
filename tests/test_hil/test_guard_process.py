"""The guard as a process: what ends a run, and that the output is off afterwards. Nothing is timed here."""

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
from bender_hil.guard.start import GuardProcess
from bender_hil.live.page import Shown, charts, facts
from bender_hil.log.journal import read_journal
from bender_hil.log.read_run import RUN
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


def test_the_page_shows_the_way_down_of_a_guard_that_was_stopped(supply: EmulatedSupply, tmp_path: Path):
    begin_s = time.perf_counter()
    start = {"n": 0, "t": begin_s, "kind": "start", "emulated": True}
    tick = {"n": 1, "t": begin_s, "kind": "tick", "grabbed_s": begin_s, "sent_s": begin_s, "command_V": 0.0, "frame": 1}
    (tmp_path / RUN).write_text(f"{json.dumps(start)}\n{json.dumps(tick)}\n")
    guard = GuardProcess(orders(supply.resource, tmp_path, replace(QUICK, ramp_V_per_s=100.0)))
    drive(guard, 15)
    shown, seen = Shown(tmp_path, None, ""), []
    guard.trip("stop", "STOP was pressed")
    while not shown.end:
        shown.look(0.0)
        seen.append(dict(facts(shown))["measured"])
        time.sleep(0.005)
    assert guard.wait().alarm == ""
    words = [word.split(",")[0].split(";")[0] for word in seen]
    assert {"falling", "off"} <= set(words)
    assert words.index("off") > words.index("falling")
    (began,) = _entries(tmp_path, "ramp")
    (came_down,) = _entries(tmp_path, "came_down")
    steps = came_down["steps"]
    assert isinstance(steps, list)
    assert (steps[0][1], steps[-1][1]) == (pytest.approx(began["from_V"], abs=1.0), 0.0)
    command, _, after = charts(shown)["voltage"]
    assert command[-1][1] == 0.0
    assert len([volts for _, volts in command if volts]) >= 20
    assert [volts for _, volts in after][-1] == _entries(tmp_path, "harmless")[0]["measured_V"]


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


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (None, "."),
        pytest.param("SIGSTOP", "silent", marks=pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")),
    ],
)
def test_a_guard_that_is_killed_or_hangs_is_replaced_by_one_that_makes_safe(
    supply: EmulatedSupply, tmp_path: Path, number: str | None, words: str
):
    guard = GuardProcess(orders(supply.resource, tmp_path))
    drive(guard, 12)
    assert supply.truth()["is_on"]
    if number is None:
        guard.process.kill()
    else:
        guard.process.send_signal(getattr(signal, number))
    with pytest.raises(ClosedError, match=words):
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
