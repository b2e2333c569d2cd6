"""Controller and guard are both lost: the watchman makes safe, or raises the alarm."""

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Self

import pytest
from emulated_bench import QUICK, assert_off, drive, orders
from few import few

from bender_emulator.start import EmulatedSupply
from bender_hil.guard.guard import Status
from bender_hil.guard.spares import start_process
from bender_hil.guard.start import GuardProcess
from bender_hil.guard.watched import Watchman
from bender_hil.guard.watchman import Known
from bender_loop.errors import InputError
from bender_loop.shell.last_word import UNKNOWN, number_of_outputs, status_at_last
from bender_loop.shell.messages import call

pytest.importorskip("pyvisa_py")
pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")


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


@pytest.mark.parametrize(("fault", "words"), [("stuck_on", UNKNOWN), ("other_unit", "EMU000002")])
def test_controller_and_guard_killed_and_an_output_that_cannot_be_confirmed_off_is_an_alarm(
    supply: EmulatedSupply, tmp_path: Path, fault: str, words: str
):
    """It is stuck, or a second unit of the model answers at the address, whose word the watchman does not take."""
    with Orphaned(supply, tmp_path) as orphaned:
        supply.fault(fault)
        os.kill(orphaned.guard, signal.SIGKILL)
        orphaned.process.kill()
        said = orphaned.complaint("no guard", 15.0)
    assert UNKNOWN in said
    assert words in said
    assert "the output is off" not in said
    assert supply.truth()["is_on"]


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
    before = number_of_outputs()
    guard = GuardProcess(orders(supply.resource, tmp_path))
    assert number_of_outputs() == before + 1
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
    # whatever the command comes to after that, this is its status and its last line
    assert status_at_last(0, before) == Status.UNCONFIRMED
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


def test_a_watchman_that_is_dismissed_comes_to_no_output(tmp_path: Path):
    """The controller has raised the alarm itself: nobody else tries, and nothing is left open."""
    watchman = Watchman(orders("TCPIP::127.0.0.1::9::SOCKET", tmp_path))
    guard = call(watchman.port, watchman.password)
    guard.send({"say": "arming", "identity": None, "pid": None})
    watchman.dismiss()
    guard.close()
    assert watchman._process.returncode == 0
    assert watchman._line == -1


def test_a_guard_whose_starter_is_lost_before_it_says_what_for_says_nothing():
    words = [sys.executable, "-P", "-m", "bender_hil.guard"]
    found = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60.0, check=False)
    assert (found.returncode, found.stderr) == (int(Status.REFUSED), "")
