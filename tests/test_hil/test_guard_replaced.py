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
from typing import Any, Self

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
from bender_hil.guard.watched import Watchman
from bender_hil.guard.watchman import Known
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
    monkeypatch.setattr(spares, "_CALLS_S", (0.01, 0.01, 20.0))
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


@pytest.fixture
def supply(running: EmulatedSupply) -> EmulatedSupply:
    running.make_ready()
    return running


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


LEAVES = "sys.stdin.readline()\nos._exit(9)\n"
CANNOT_START = (
    "import resource\n"
    "open_now = len(os.listdir('/proc/self/fd'))\n"
    "resource.setrlimit(resource.RLIMIT_NOFILE, (open_now, open_now))\n"
    "sys.stdin.readline()\nprint(int(guard.wait().status), flush=True)\n"
)


class Orphaned:
    """A controller of its own, which waits at 30 V for its standard input, and what it and all that it started say.

    On leaving, everybody who holds its standard error has ended: no guard of one test comes to the supply of the next.

    Attributes:
        process: of the controller.
        guard: pid of its guard.
    """

    def __init__(self, supply: EmulatedSupply, folder: Path, then: str = LEAVES) -> None:
        code = (
            "import sys, time, os\n"
            "from bender_hil.guard.settings import GuardOrders\nfrom bender_hil.guard.start import GuardProcess\n"
            "guard = GuardProcess(GuardOrders.from_json(sys.stdin.readline()))\n"
            "for tick in range(20):\n"
            "    guard.command(tick, min(30.0, 3.0 * tick), time.perf_counter(), 0.0)\n    time.sleep(0.02)\n"
            "print(guard.process.pid, flush=True)\n"
            f"{then}"
        )
        pipe = subprocess.PIPE
        words = [sys.executable, "-c", code]
        self.process = subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=pipe, text=True)
        self._said: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        patient = replace(QUICK, heartbeat_s=5.0, frame_age_s=5.0)
        self.write(orders(supply.resource, folder, patient).to_json())
        self.guard = int(self.line())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._reader.join(timeout=40.0)
        assert not self._reader.is_alive(), "somebody whom the controller started lives on"
        for stream in (self.process.stdin, self.process.stdout, self.process.stderr):
            if stream is not None:
                stream.close()

    def write(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline()

    def complaint(self, words: str, limit_s: float) -> str:
        """Return what has been said, as soon as `words` are in it."""
        end_s = time.perf_counter() + limit_s
        while words not in (text := "".join(self._said)) and time.perf_counter() < end_s:
            time.sleep(0.02)
        return text

    def _read(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self._said.append(line)


def test_an_orphan_that_cannot_switch_off_shouts(supply: EmulatedSupply, tmp_path: Path):
    """The controller is gone, the output stays on: the guard itself is the first to say so."""
    with Orphaned(supply, tmp_path) as orphaned:
        supply.fault("stuck_on")
        orphaned.process.kill()
        limit_s = QUICK.shutdown_limit_s + QUICK.discharge_limit_s + 3.0
        assert UNKNOWN in orphaned.complaint(UNKNOWN, limit_s)
        # the watchman tries again, and finds it as it is by then
        supply.reset()
        assert "the output is off" in orphaned.complaint("no guard", 15.0)
    assert_off(supply)


@pytest.mark.parametrize("between_s", few([0.0, 0.02, 0.1], 0))
def test_controller_and_guard_killed_one_after_the_other_leave_nothing_on(
    supply: EmulatedSupply, tmp_path: Path, between_s: float
):
    with Orphaned(supply, tmp_path) as orphaned:
        assert supply.truth()["output_V"] > 20.0
        # what comes down by itself must not hide what is tested
        supply.fault("delay_s", 0.05)
        orphaned.process.kill()
        time.sleep(between_s)
        os.kill(orphaned.guard, signal.SIGKILL)
        supply.fault("delay_s", 0.0)
        assert "the output is off" in orphaned.complaint("no guard", 15.0)
    assert_off(supply)


def test_controller_and_guard_killed_and_a_stuck_output_is_an_alarm(supply: EmulatedSupply, tmp_path: Path):
    with Orphaned(supply, tmp_path) as orphaned:
        supply.fault("stuck_on")
        os.kill(orphaned.guard, signal.SIGKILL)
        orphaned.process.kill()
        said = orphaned.complaint("no guard", 15.0)
    assert UNKNOWN in said
    assert "the output is off" not in said


@pytest.mark.slow
def test_a_controller_killed_and_a_guard_that_is_stopped_leave_nothing_on(supply: EmulatedSupply, tmp_path: Path):
    with Orphaned(supply, tmp_path) as orphaned:
        os.kill(orphaned.guard, signal.SIGSTOP)
        orphaned.process.kill()
        assert "the output is off" in orphaned.complaint("no guard", 25.0)
    assert_off(supply)


@pytest.mark.skipif(not os.path.exists("/proc/self/fd"), reason="counts descriptors by /proc")
def test_a_controller_that_can_start_no_guard_any_more_leaves_the_output_to_the_watchman(
    supply: EmulatedSupply, tmp_path: Path
):
    with Orphaned(supply, tmp_path, CANNOT_START) as orphaned:
        os.kill(orphaned.guard, signal.SIGKILL)
        orphaned.write("go on")
        # the watchman's guard switches off; its word is not that of a guard of this controller
        assert int(orphaned.line()) == Status.UNCONFIRMED
        said = orphaned.complaint("made safe", 15.0)
    assert UNKNOWN in said
    assert "another one made safe, the output is off" in said
    assert_off(supply)


def test_the_watchman_knows_when_an_output_may_be_on():
    known = Known()
    known.take("came", None)
    assert not known.may_be_on
    known.take("said", {"say": "arming", "identity": ["B&K", "9115", "1", "V1"], "pid": 7})
    assert known.may_be_on
    known.take("went", None)
    assert not known.is_alone
    known.take("controller_gone", None)
    assert known.is_alone
    known.take("said", {"say": "end", "confirmed": False})
    assert known.may_be_on
    known.take("said", {"say": "end", "confirmed": True})
    assert not known.may_be_on
    assert known.identity == ["B&K", "9115", "1", "V1"]


@pytest.mark.slow
def test_a_spare_without_a_controller_switches_off_all_the_same(supply: EmulatedSupply, tmp_path: Path):
    guard = GuardProcess(orders(supply.resource, tmp_path))
    drive(guard, 12)
    guard.process.kill()
    guard.process.wait()
    process = start_process(replace(orders(supply.resource, tmp_path / "nowhere"), make_safe=True))
    assert process.wait(10.0) == Status.TRIPPED
    assert_off(supply)
    guard._watchman.dismiss()
    guard._channel.close()


def test_a_guard_whose_journal_cannot_be_made_refuses_before_it_opens_anything(supply: EmulatedSupply, tmp_path: Path):
    (tmp_path / "guard.jsonl").write_text("an older run")
    with pytest.raises(InputError, match="already holds a run"):
        GuardProcess(orders(supply.resource, tmp_path))
    assert not supply.truth()["is_remote"]
    assert (tmp_path / "guard.jsonl").read_text() == "an older run"


def test_a_second_unit_at_the_address_cannot_say_off_for_the_one_that_was_opened(
    supply: EmulatedSupply, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    guard = GuardProcess(orders(supply.resource, tmp_path))
    drive(guard, 12)
    supply.fault("other_unit")
    guard.process.kill()
    ended = guard.wait()
    truth = supply.truth()
    assert truth["is_on"]
    assert truth["output_V"] > 20.0
    assert ended.status is Status.UNCONFIRMED
    assert "EMU000002" in ended.alarm
    assert UNKNOWN in capfd.readouterr().err


def test_a_watchman_that_has_the_output_is_not_ended_in_the_middle_of_it(tmp_path: Path):
    watchman = Watchman(orders("TCPIP::127.0.0.1::9::SOCKET", tmp_path))
    process = watchman._process
    os.kill(process.pid, signal.SIGSTOP)
    try:
        watchman.hand_over(0.1)
        assert process.poll() is None
        os.kill(process.pid, signal.SIGCONT)
        # without a controller and with nothing on, it leaves by itself
        assert process.wait(timeout=20.0) == 0
    finally:
        process.kill()
        process.wait()


def test_a_guard_whose_starter_is_lost_before_it_says_what_for_says_nothing():
    words = [sys.executable, "-P", "-m", "bender_hil.guard"]
    found = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60.0, check=False)
    assert (found.returncode, found.stderr) == (int(Status.REFUSED), "")
