"""Every way to lose or stop a process of a run, in every state: the controller, the guard, all of a terminal.

A stand-in for the controller drives a guard on an emulated supply; the truth is read behind the supply's terminals,
and an alarm counts when it stands on the standard error, where somebody at the bench would see it. POSIX only.
"""

import contextlib
import itertools
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from bender_emulator.start import EmulatedSupply
from bender_hil.guard.settings import GuardOrders
from bender_hil.supply.select import SupplySettings
from bender_loop.errors import RunError
from bender_loop.shell.last_word import UNKNOWN
from bender_studies.bench_trials.fault_matrix import LIMITS, STATES, Cell, journal_faults
from bender_studies.bench_trials.stand_in import MISBEHAVIOUR

SIGNALS = ("SIGKILL", "SIGSTOP", "SIGTSTP", "SIGQUIT", "SIGTERM", "SIGINT", "SIGHUP")
TARGETS = ("controller", "guard", "terminal")
FILES: dict[str, Callable[[Path], object]] = {
    "guard killed, rescue.jsonl taken": lambda folder: (folder / "rescue.jsonl").write_text("taken\n"),
    "guard killed, folder removed": lambda folder: shutil.rmtree(folder),
    "guard killed, folder a file": lambda folder: (shutil.rmtree(folder), folder.write_text("")),
}
NO_ROOM = ("disk full", "guard killed on a full disk")
SPARES = ("guard and 1 spare killed", "guard and 2 spares killed", "guard and 1 spare stopped")
BOTH = {
    "guard and controller killed at once": 0.0,
    "guard killed 20 ms after the controller": 0.02,
    "guard killed 100 ms after the controller": 0.1,
    "guard killed 200 ms after the controller": 0.2,
}
"""Which process is killed first, and after how many seconds the other one; the watchman is left."""
STOPPED = "controller killed, guard stopped"

_WITHIN_S = LIMITS.shutdown_limit_s + 1.0
_SLOW = replace(LIMITS, ramp_V_per_s=1.0)
"""So that the way down takes long enough to be disturbed."""
_START_S = 20.0


def process_faults() -> list[tuple[str, str]]:
    """All pairs of fault and state."""
    signals = [f"{name} to the {target}" for name in SIGNALS for target in TARGETS]
    found = list(itertools.product(signals, STATES))
    found += [(f"controller {what}", "holding") for what in MISBEHAVIOUR]
    found += list(itertools.product((*FILES, *SPARES, NO_ROOM[1]), ("rising", "holding", "descending")))
    found += list(itertools.product((*BOTH, STOPPED), ("rising", "holding", "descending")))
    return [*found, (NO_ROOM[0], "holding")]


def run_process_cell(supply: EmulatedSupply, fault: str, state: str, folder: Path) -> Cell:
    """Run one cell on an emulated supply that nobody else uses; leaves it as after the mains switch.

    Args:
        supply: running.
        fault: one of `process_faults`.
        state: that stands there with it.
        folder: of the run; made here.

    Raises:
        RunError: the run does not reach its state.
    """
    supply.make_ready()
    run = folder / f"{fault}-{state}".replace(" ", "-").replace(",", "")
    run.mkdir(parents=True)
    trial = _Trial(supply, fault, state, run)
    try:
        return trial.run()
    finally:
        trial.close()


class _Trial:
    """One cell: the stand-in, its guards, and what is seen of them from outside."""

    def __init__(self, supply: EmulatedSupply, fault: str, state: str, run: Path) -> None:
        self._supply, self._fault, self._state, self._run = supply, fault, state, run
        self._complaints = run.with_name(f"{run.name}.txt")
        with self._complaints.open("wb") as stream:
            self._child = subprocess.Popen(
                [sys.executable, "-P", "-m", "bender_studies.bench_trials.stand_in"],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=stream, text=True, process_group=0,
                preexec_fn=_no_room if fault in NO_ROOM else None,
            )  # fmt: skip
        self._guard = 0
        self._family: set[int] = set()

    def run(self) -> Cell:
        """To its state, and through the fault."""
        self._start()
        event_s = time.perf_counter()
        _do(self._fault, self._child.pid, self._guard, self._run)
        off_s, alarm_s = self._wait(event_s)
        runs_on = off_s is None and alarm_s is None and self._runs_on()
        if runs_on:
            self._child.send_signal(signal.SIGTERM)
        said = self._last_word()
        truth = self._supply.truth()
        is_harmless = truth["output_V"] < LIMITS.safe_V
        outcome = (
            "runs on" if runs_on else "alarm" if alarm_s is not None else "off" if off_s is not None
            else "0 V" if is_harmless else "on"
        )  # fmt: skip
        seconds = min((when_s - event_s for when_s in (off_s, alarm_s) if when_s is not None), default=None)
        code, remaining_V = said.get("code"), float(truth["output_V"])
        broken = self._broken(outcome, seconds, said, truth)
        return Cell(self._fault, self._state, outcome, code, remaining_V, "; ".join(broken), seconds)

    def close(self) -> None:
        """Nothing of it is left, and the supply as after the mains switch."""
        self._note_family()
        for pid in self._family | {self._child.pid}:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        self._child.communicate()
        self._supply.power_on()

    def _start(self) -> None:
        fault, state, child = self._fault, self._state, self._child
        limits = _SLOW if state == "descending" else LIMITS
        if fault.startswith("controller "):
            limits = replace(limits, heartbeat_s=0.4, frame_age_s=0.4)
        journal = str(self._run / "guard.jsonl")
        orders = GuardOrders(SupplySettings(self._supply.resource, timeout_s=0.1), journal, limits)
        if state == "opening":
            self._supply.fault("delay_s", 0.02)
        if child.stdin is None or child.stdout is None:
            raise RunError("the stand-in has no pipes")
        asked = fault.removeprefix("controller ")
        child.stdin.write(f"{asked if asked in MISBEHAVIOUR else state}\n{orders.to_json()}\n")
        child.stdin.flush()
        if state == "opening":
            _wait_until(lambda: bool(self._supply.truth()["is_remote"]))
            self._guard = _guards(child.pid)[0]
        else:
            self._guard = _reached(child.stdout.readline(), self._complaints)
        self._note_family()

    def _note_family(self) -> None:
        known = {self._child.pid, *self._family, *([self._guard] if self._guard else [])}
        # the watchman starts a guard of its own
        self._family |= known.union(*(_children(pid) for pid in known))

    def _wait(self, event_s: float) -> tuple[float | None, float | None]:
        """When the output went off, and when an alarm was raised; None for what did not come."""
        off_s = alarm_s = None
        while time.perf_counter() < event_s + _WITHIN_S + 1.0 and off_s is None:
            self._note_family()
            if alarm_s is None and UNKNOWN in self._complaints.read_text(errors="replace"):
                alarm_s = time.perf_counter()
            truth = self._supply.truth()
            if not truth["is_on"]:
                off_s = max(event_s, float(truth["switched_off_s"]))
            time.sleep(0.01)
        return off_s, alarm_s

    def _runs_on(self) -> bool:
        """Whether the fault has left both processes at their work."""
        return self._child.poll() is None and not _is_stopped(self._child.pid) and _is_alive(self._guard)

    def _last_word(self) -> dict[str, Any]:
        """What the stand-in says of the run; nothing from one that is lost, or stopped and therefore ended here."""
        child = self._child
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(timeout=0.1 if _is_stopped(child.pid) else 6.0)
        if child.poll() is None:
            child.kill()
        lines = child.stdout.read().splitlines() if child.stdout is not None else []
        words = [json.loads(line) for line in lines]
        return words[-1] if words and "outcome" in words[-1] else {}

    def _broken(self, outcome: str, seconds: float | None, said: dict[str, Any], truth: dict[str, Any]) -> list[str]:
        faults = []
        if outcome == "on":
            faults.append(f"{truth['output_V']:.2f} V are on, and nobody says so")
        if (said.get("outcome") == "off" or outcome == "runs on") and truth["is_on"]:
            faults.append("the output is on after the end")
        if seconds is not None and seconds > _WITHIN_S:
            faults.append(f"{seconds:.2f} s to the output off or the alarm")
        return faults + self._journal_faults(said)

    def _journal_faults(self, said: dict[str, Any]) -> list[str]:
        """No entry is missing, and a guard that was not lost has written its last one."""
        path = self._run / "guard.jsonl"
        is_killed = self._fault in ("SIGKILL to the guard", "SIGSTOP to the guard")
        is_lost = is_killed or said.get("code") == "guard_gone" or not said or self._fault in NO_ROOM
        if not path.exists() and self._fault in FILES:
            return []
        end_s = time.perf_counter() + 3.0
        while (found := journal_faults(path)) and not is_lost and time.perf_counter() < end_s:
            time.sleep(0.05)
        return [fault for fault in found if not (is_lost and "ends with" in fault)]


def _do(fault: str, controller: int, guard: int, run: Path) -> None:
    """Do what the fault's name says."""
    name, _, target = fault.partition(" to the ")
    if target:
        number = getattr(signal, name)
        if target == "terminal":
            os.killpg(controller, number)
        else:
            os.kill({"controller": controller, "guard": guard}[target], number)
    elif fault in FILES or fault == NO_ROOM[1]:
        FILES.get(fault, Path.exists)(run)
        os.kill(guard, signal.SIGKILL)
    elif fault in SPARES:
        number = signal.SIGSTOP if fault.endswith("stopped") else signal.SIGKILL
        os.kill(guard, number)
        before = {guard}
        for _ in range(2 if "2" in fault else 1):
            before.add(_lose_the_next(controller, before, number))
    elif fault in BOTH:
        first, second = (controller, guard) if BOTH[fault] else (guard, controller)
        os.kill(first, signal.SIGKILL)
        time.sleep(BOTH[fault])
        with contextlib.suppress(ProcessLookupError):
            os.kill(second, signal.SIGKILL)
    elif fault == STOPPED:
        os.kill(guard, signal.SIGSTOP)
        os.kill(controller, signal.SIGKILL)


def _lose_the_next(controller: int, before: set[int], number: int) -> int:
    """Lose the spare guard as soon as it is there, before it has done anything."""
    end_s = time.perf_counter() + _START_S
    while time.perf_counter() < end_s:
        # a child that has not begun its own program yet still is a copy of the controller, which waits for it
        fresh = [pid for pid in _guards(controller) if pid not in before]
        if fresh:
            os.kill(fresh[0], number)
            return fresh[0]
        time.sleep(0.005)
    raise RunError("no spare guard was started")


def _reached(line: str, complaints: Path) -> int:
    found = json.loads(line) if line else {}
    if "guard" not in found:
        raise RunError(f"the run did not reach its state: {line.strip()} {complaints.read_text(errors='replace')}")
    return int(found["guard"])


def _wait_until(is_so: Callable[[], bool]) -> None:
    end_s = time.perf_counter() + _START_S
    while not is_so():
        if time.perf_counter() > end_s:
            raise RunError("the run did not begin")
        time.sleep(0.005)


def _children(pid: int) -> list[int]:
    with contextlib.suppress(OSError):
        return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return []


def _guards(pid: int) -> list[int]:
    """The guards that a controller has started; the watchman is none."""
    return [child for child in _children(pid) if b"bender_hil.guard\0" in _words(child)]


def _words(pid: int) -> bytes:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    return b""


def _is_stopped(pid: int) -> bool:
    return _process_state(pid) in ("T", "t")


def _is_alive(pid: int) -> bool:
    return _process_state(pid) not in ("", "T", "t", "Z", "X")


def _process_state(pid: int) -> str:
    """The letter of the process in the kernel's table, empty for none."""
    with contextlib.suppress(OSError, IndexError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    return ""


def _no_room() -> None:
    """Files of more than some 20 kB fail to be written, as on a full disk."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
