"""A guard that is lost: only a word is a confirmation, and the spare one switches off before it writes."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from emulated_bench import QUICK, assert_off, drive, emulated_supply, orders
from few import few, few_rows

from bender_emulator.start import EmulatedSupply
from bender_hil.guard import spares
from bender_hil.guard import start as module
from bender_hil.guard.guard import Status
from bender_hil.guard.settings import GuardOrders
from bender_hil.guard.spares import WayDown, start_process
from bender_hil.guard.start import GuardProcess, OutputUnknownError
from bender_hil.supply.select import SupplySettings
from bender_loop.errors import InputError, RunError
from bender_loop.shell.last_word import UNKNOWN, number_of_outputs, status_at_last
from bender_loop.shell.messages import ClosedError

pytest.importorskip("pyvisa_py")
pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")

FAKE = """
import json, sys, time
from bender_hil.guard.settings import GuardOrders
from bender_loop.shell.messages import call
orders = GuardOrders.from_json(sys.stdin.readline())
channel = call(orders.port, orders.password)
script = json.loads(sys.argv[1])["spare" if orders.make_safe else "guard"]
for wait_s, message in script:
    time.sleep(wait_s)
    channel.send(message)
sys.exit(json.loads(sys.argv[1]).get("status", 1))
"""
READY: dict[str, Any] = {"say": "ready", "emulated": True}
OFF: dict[str, Any] = {"say": "off", "off_s": 0.0}
END: dict[str, Any] = {
    "say": "end", "status": 0, "confirmed": True, "off_s": 0.0, "harmless_s": 0.0, "code": None, "sentence": None,
    "alarm": "",
}  # fmt: skip
ALIVE: dict[str, Any] = {"say": "alive"}
OPENED: dict[str, Any] = {"say": "opened", "identity": ["B&K", "9115", "1", "V1"]}
SETTINGS = GuardOrders(SupplySettings("TCPIP::127.0.0.1::1::SOCKET"), "guard.jsonl", QUICK)

Script = list[tuple[float, dict[str, Any]]]


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[subprocess.Popen[str]]]:
    """Guards that say what a script says and end with status 1, as one that crashes does."""
    started: list[subprocess.Popen[str]] = []

    def use(guard: Script, spare: Script, status: int = 1) -> list[subprocess.Popen[str]]:
        def start(given: GuardOrders) -> subprocess.Popen[str]:
            words = [sys.executable, "-c", FAKE, json.dumps({"guard": guard, "spare": spare, "status": status})]
            process = subprocess.Popen(words, stdin=subprocess.PIPE, text=True)
            assert process.stdin is not None
            with process.stdin as stdin:
                stdin.write(given.to_json() + "\n")
            started.append(process)
            return process

        monkeypatch.setattr(module, "start_process", start)
        return started

    return use


def test_a_spare_that_crashes_has_not_made_safe(scripted: Callable[..., list], capfd: pytest.CaptureFixture[str]):
    """The gravest of all: status 1 of a process was taken for its word."""
    started = scripted([(0.0, READY)], [(0.0, ALIVE)])
    ended = GuardProcess(SETTINGS).wait()
    assert ended.status is Status.UNCONFIRMED
    assert ended.alarm == UNKNOWN
    assert ended.code == "guard_gone"
    assert len(started) == 4  # one guard, three spares
    assert all(process.poll() is not None for process in started)
    capfd.readouterr()


def test_the_first_spare_that_says_so_has_made_safe(scripted: Callable[..., list]):
    started = scripted([(0.0, READY)], [(0.0, OFF), (0.0, {**END, "status": 1})], 0)
    guard = GuardProcess(SETTINGS)
    ended = guard.wait()
    assert (ended.status, ended.code, ended.alarm) == (Status.TRIPPED, "guard_gone", "")
    assert guard.wait() is ended
    assert len(started) == 2


def test_the_last_spare_is_given_up_late(scripted: Callable[..., list], monkeypatch: pytest.MonkeyPatch):
    # a machine too busy for the first ones: each would have called, had it been left alone
    monkeypatch.setattr(spares, "_CALLS_S", (0.0, 0.0, 20.0))
    processes = scripted([(0.0, READY)], [(0.0, OFF), (0.0, END)])
    guard = GuardProcess(SETTINGS)
    ended = guard.wait()
    assert (ended.status, ended.alarm) == (Status.TRIPPED, "")
    assert len(processes) == 4


@pytest.mark.parametrize("confirmed", few([False, None, 1, "true"], 0, 3))
def test_an_end_that_does_not_confirm_is_no_confirmation_and_said_at_once(
    scripted: Callable[..., list], confirmed: object, capfd: pytest.CaptureFixture[str]
):
    end = {**END, "confirmed": confirmed}
    scripted([(0.0, READY)], [(0.0, end)])
    assert GuardProcess(SETTINGS).wait().status is Status.UNCONFIRMED
    scripted([(0.0, READY), (0.0, end)], [])
    ended = GuardProcess(SETTINGS).wait()
    assert (ended.status, ended.alarm) == (Status.UNCONFIRMED, UNKNOWN)
    assert capfd.readouterr().err.count(UNKNOWN) == 2


@pytest.mark.parametrize("error", [MemoryError(), OSError(24, "too many open files"), ValueError("?")])
def test_a_spare_that_cannot_be_started_is_an_alarm_and_no_failure(error: Exception):
    def start(_: GuardOrders) -> "subprocess.Popen[str]":
        raise error

    way = WayDown(SETTINGS, start)
    ended = way.make_safe(SETTINGS)
    assert (ended.status, ended.alarm) == (Status.UNCONFIRMED, UNKNOWN)
    assert way.is_lost


@pytest.mark.parametrize(
    ("said", "has_tripped"),
    [([], False), (["alive"], False), (["alive", "alive"], False), (["alive", "tripped"], True), (["end"], True)],
)
def test_a_guard_that_says_more_than_that_it_is_alive_has_ended_the_run(said: list[str], has_tripped: bool):
    waiting = [{"say": word} for word in said]
    guard = object.__new__(GuardProcess)
    guard._channel = SimpleNamespace(receive=lambda _: waiting.pop(0) if waiting else None)  # pyright: ignore
    guard._way, guard._end = WayDown(SETTINGS, start_process), None
    assert guard.has_tripped() == has_tripped
    assert guard._end == ({"say": "end"} if "end" in said else None)


def test_the_alarm_comes_when_it_is_due_and_not_before(
    scripted: Callable[..., list], capfd: pytest.CaptureFixture[str]
):
    """A guard that shows life and never says that the output is off."""
    scripted([(0.0, READY), *[(0.2, ALIVE)] * 10, (0.0, OFF), (0.0, END)], [])
    guard = GuardProcess(SETTINGS)
    start_s = time.perf_counter()
    ended = guard.wait()
    assert guard.alarmed_s is not None
    assert QUICK.shutdown_limit_s <= guard.alarmed_s - start_s < QUICK.shutdown_limit_s + 1.0
    assert capfd.readouterr().err.count(UNKNOWN) == 1
    assert ended.status is Status.DONE  # and what it finds out in the end, counts


def test_a_guard_that_ends_well_is_believed_and_an_output_that_is_off_in_time_raises_no_alarm(
    scripted: Callable[..., list], capfd: pytest.CaptureFixture[str]
):
    started = scripted([(0.0, READY), (0.1, OFF), *[(0.3, ALIVE)] * 3, (0.0, END)], [])
    guard = GuardProcess(SETTINGS)
    ended = guard.wait()
    assert (ended.status, ended.code, ended.alarm) == (Status.DONE, None, "")
    assert len(started) == 1
    assert guard.alarmed_s is None
    assert capfd.readouterr().err == ""


def test_live_terminals_are_said_at_once(scripted: Callable[..., list], capfd: pytest.CaptureFixture[str]):
    scripted([(0.0, READY), (0.0, OFF), (0.0, {"say": "overdue", "sentence": "12 V"}), (0.1, END)], [])
    guard = GuardProcess(SETTINGS)
    guard.wait()
    assert guard.alarmed_s is not None
    assert "12 V: do not touch it" in capfd.readouterr().err


def test_a_guard_that_never_ends_after_off_is_given_up(scripted: Callable[..., list]):
    started = scripted([(0.0, READY), (0.0, OFF), *[(0.2, ALIVE)] * 60], [(0.0, {**END, "status": 1})])
    start_s = time.perf_counter()
    assert GuardProcess(SETTINGS).wait().status is Status.TRIPPED
    assert QUICK.discharge_limit_s <= time.perf_counter() - start_s < QUICK.discharge_limit_s + 4.0
    assert len(started) == 2


def _ask_for_ever(guard: GuardProcess) -> None:
    while True:
        guard.has_tripped()
        time.sleep(0.01)


def test_a_silent_guard_is_lost_since_its_last_word(scripted: Callable[..., list]):
    scripted([(0.0, READY), (30.0, ALIVE)], [(0.0, {**END, "status": 1})])
    guard = GuardProcess(SETTINGS)
    start_s = time.perf_counter()
    with pytest.raises(ClosedError, match="silent"):
        _ask_for_ever(guard)
    assert 0.9 < time.perf_counter() - start_s < 2.0
    assert guard.process.wait(5.0) == -signal.SIGKILL
    assert guard._way.heard_s < start_s + 0.1
    guard.wait()
    assert guard._way.due_s == guard._way.heard_s or guard._way.due_s < start_s + QUICK.shutdown_limit_s + 0.2


def test_a_guard_that_hung_before_the_planned_end_is_lost_since_its_last_word_too(scripted: Callable[..., list]):
    """The end of the run gives a guard that says nothing no further time."""
    scripted([(0.0, READY), (30.0, ALIVE)], [(0.0, {**END, "status": 1})])
    guard = GuardProcess(SETTINGS)
    last_word_s = guard._way.heard_s
    while time.perf_counter() < last_word_s + 0.7:
        assert not guard.has_tripped()
        time.sleep(0.01)
    guard.stop()
    assert guard.wait().code == "guard_gone"
    assert guard._way.due_s == pytest.approx(last_word_s + QUICK.shutdown_limit_s)


def test_a_guard_that_speaks_after_the_planned_end_has_all_its_time(scripted: Callable[..., list]):
    scripted([(0.0, READY), (0.9, ALIVE), (0.0, OFF), (0.0, END)], [])
    guard = GuardProcess(SETTINGS)
    last_word_s = guard._way.heard_s
    while time.perf_counter() < last_word_s + 0.6:
        assert not guard.has_tripped()
        time.sleep(0.01)
    asked_s = time.perf_counter()
    assert guard.wait().status is Status.DONE
    assert guard._way.due_s >= asked_s + QUICK.shutdown_limit_s


def test_what_is_torn_apart_comes_down_and_says_when_it_did_not(
    scripted: Callable[..., list], capfd: pytest.CaptureFixture[str]
):
    scripted([(0.0, READY), (0.0, {**END, "confirmed": False, "status": 3, "alarm": "loud words"})], [])
    guard = GuardProcess(SETTINGS)
    guard.close()
    guard.close()
    assert capfd.readouterr().err.count("loud words") == 1


@pytest.mark.parametrize(
    ("words", "error", "match"),
    few_rows(
        [
            ({"say": "refused", "status": 2, "sentence": "no"}, InputError, "SOCKET: no"),
            ({"say": "refused", "status": 1, "sentence": "TCPIP::127.0.0.1::1::SOCKET is not"}, RunError, "^TCPIP"),
            ({**END, "status": 2, "sentence": "weak"}, InputError, "could not be armed: weak"),
            ({**END, "status": 1, "sentence": "lost"}, RunError, "could not be armed: lost"),
            ({**END, "status": 3, "confirmed": False, "alarm": "ALARM"}, OutputUnknownError, "ALARM"),
        ],
        0,
        4,
    ),
)
def test_what_a_guard_says_instead_of_ready(
    scripted: Callable[..., list], words: dict[str, Any], error: type[Exception], match: str
):
    scripted([(0.3, words)], [])
    with pytest.raises(error, match=match):
        GuardProcess(SETTINGS)


def test_a_guard_lost_while_it_arms_is_replaced(scripted: Callable[..., list]):
    started = scripted([(0.0, OPENED)], [(0.0, {**END, "status": 1})])
    with pytest.raises(RunError, match="another one made safe"):
        GuardProcess(SETTINGS)
    assert len(started) == 2


def test_a_guard_lost_before_it_has_opened_anything_has_switched_nothing(
    scripted: Callable[..., list], capfd: pytest.CaptureFixture[str]
):
    before = number_of_outputs()
    started = scripted([(0.0, ALIVE)], [])
    with pytest.raises(RunError, match="nothing was switched on") as raised:
        GuardProcess(SETTINGS)
    assert not isinstance(raised.value, OutputUnknownError)
    assert len(started) == 1
    assert status_at_last(1, before) == 1
    assert UNKNOWN not in capfd.readouterr().err


# with a real guard and a real supply


def test_the_supply_is_ready_when_nobody_who_was_dropped_comes_again(supply: EmulatedSupply):
    def come_twice() -> None:
        for stay_s in (10.0, 0.2):
            there = socket.create_connection(("127.0.0.1", supply.port), timeout=stay_s)
            with there as stream, contextlib.suppress(TimeoutError):
                assert not stream.recv(1)
            time.sleep(0.1)

    visitor = threading.Thread(target=come_twice, daemon=True)
    visitor.start()
    while not supply.truth()["is_busy"]:
        time.sleep(0.005)
    supply.make_ready()
    assert not visitor.is_alive()


@pytest.mark.parametrize("obstacle", few(["folder removed", "every name taken", "a file instead"], 0))
def test_a_journal_that_cannot_be_opened_does_not_keep_the_spare_from_switching_off(
    supply: EmulatedSupply, tmp_path: Path, obstacle: str
):
    folder = tmp_path / "run"
    folder.mkdir()
    guard = GuardProcess(orders(supply.resource, folder))
    drive(guard, 12)
    assert supply.truth()["output_V"] > 20.0
    if obstacle == "every name taken":
        for name in ("rescue.jsonl", *(f"rescue-{number}.jsonl" for number in range(2, 10))):
            (folder / name).write_text("mine")
    else:
        (folder / "guard.jsonl").unlink()
        folder.rmdir()
        if obstacle == "a file instead":
            folder.write_text("")
    guard.process.kill()
    ended = guard.wait()
    assert (ended.status, ended.code, ended.alarm) == (Status.TRIPPED, "guard_gone", "")
    assert_off(supply)
    if obstacle == "every name taken":
        assert (folder / "rescue.jsonl").read_text() == "mine"


def test_the_guard_is_out_of_reach_of_the_terminal_and_nothing_is_left_of_its_watchman(
    supply: EmulatedSupply, tmp_path: Path
):
    guard = GuardProcess(orders(supply.resource, tmp_path))
    pid, watchman = guard.process.pid, guard._watchman._process
    assert os.getsid(pid) == os.getpgid(pid) == pid
    for name in ("SIGTSTP", "SIGTTIN", "SIGTTOU"):
        os.kill(pid, getattr(signal, name))
    drive(guard, 12)
    assert not guard.has_tripped()
    guard.stop()
    assert guard.wait().status is Status.DONE
    assert watchman.poll() == 0


@pytest.mark.parametrize("name", few(["SIGQUIT", "SIGHUP", "SIGUSR1"], 1))
def test_a_signal_that_would_end_the_guard_brings_the_output_down(supply: EmulatedSupply, tmp_path: Path, name: str):
    guard = GuardProcess(orders(supply.resource, tmp_path))
    drive(guard, 12)
    guard.process.send_signal(getattr(signal, name))
    ended = guard.wait()
    assert (ended.status, ended.code, ended.sentence) == (Status.TRIPPED, "signal", f"{name} was sent to the guard")
    assert_off(supply)


@pytest.mark.parametrize("number", few([signal.SIGKILL, signal.SIGSTOP], 0))
def test_a_guard_lost_on_the_way_down_is_replaced_in_time(
    supply: EmulatedSupply, tmp_path: Path, number: signal.Signals
):
    limits = replace(QUICK, shutdown_limit_s=4.0, ramp_V_per_s=1.0)
    guard = GuardProcess(orders(supply.resource, tmp_path, limits))
    drive(guard, 15)
    guard.stop()
    stop_s = time.perf_counter()
    time.sleep(0.4)
    assert 1.0 < supply.truth()["output_V"] < 30.0
    guard.process.send_signal(number)
    ended = guard.wait()
    assert (ended.status, ended.code, ended.alarm) == (Status.TRIPPED, "guard_gone", "")
    assert_off(supply)
    assert supply.truth()["switched_off_s"] - stop_s < limits.shutdown_limit_s + 1.0


@pytest.mark.slow
def test_a_slow_ramp_is_made_fast_enough_and_its_guard_is_left_alone(supply: EmulatedSupply, tmp_path: Path):
    limits = replace(QUICK, shutdown_limit_s=2.0, ramp_V_per_s=1.0)
    guard = GuardProcess(orders(supply.resource, tmp_path, limits))
    drive(guard, 15)
    guard.stop()
    stop_s = time.perf_counter()
    assert guard.wait().status is Status.DONE
    assert 0.7 < supply.truth()["switched_off_s"] - stop_s < 2.0


@pytest.mark.parametrize("fault", few([("drip_s", 0.1), ("flood", "lines"), ("no_end", 1), ("answer", "1e999")], 1))
def test_a_supply_that_answers_nonsense_is_switched_off_at_once_and_the_alarm_is_in_time(
    supply: EmulatedSupply, tmp_path: Path, fault: tuple[str, Any]
):
    guard = GuardProcess(orders(supply.resource, tmp_path))
    drive(guard, 12)
    fault_s = time.perf_counter()
    supply.fault(*fault)
    drive(guard, 50)
    ended = guard.wait()
    assert ended.status is Status.UNCONFIRMED
    assert time.perf_counter() - fault_s < QUICK.shutdown_limit_s + 1.5
    truth = supply.truth()
    assert not truth["is_on"]
    assert truth["switched_off_s"] - fault_s < 1.0


@pytest.mark.slow
def test_two_lines_in_one_packet_cost_the_link_but_not_the_confirmation(supply: EmulatedSupply, tmp_path: Path):
    guard = GuardProcess(orders(supply.resource, tmp_path))
    drive(guard, 12)
    supply.fault("reset_on_merged_writes")
    drive(guard, 20)
    assert guard.wait().alarm == ""
    assert_off(supply)


def test_a_serial_line_belongs_to_one_controller(tmp_path: Path):
    with emulated_supply(tmp_path, "pty") as supply:
        patient = replace(QUICK, heartbeat_s=5.0, frame_age_s=5.0)
        guard = GuardProcess(orders(supply.resource, tmp_path, patient))
        drive(guard, 12)
        (tmp_path / "second").mkdir()
        with pytest.raises(RunError, match="another process has this port open"):
            GuardProcess(orders(supply.resource, tmp_path / "second"))
        assert supply.truth()["output_V"] > 20.0
        assert not guard.has_tripped()
        guard.stop()
        assert guard.wait().status is Status.DONE
        # and it is free again
        (tmp_path / "second" / "guard.jsonl").unlink()
        third = GuardProcess(orders(supply.resource, tmp_path / "second"))
        third.stop()
        assert third.wait().status is Status.DONE
