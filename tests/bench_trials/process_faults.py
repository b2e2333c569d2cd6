"""Every way to lose or stop a process of a run, in every state: the controller, the guard, all of a terminal.

The run is a whole `bender hil`; where the controller itself is at fault, a stand-in takes its place. The truth is read
behind the supply's terminals, and an alarm counts when it stands on the standard error, where somebody at the bench
would see it. POSIX only.
"""

import contextlib
import itertools
import os
import resource
import shutil
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from bench_trials import stand_in
from bench_trials.fault_matrix import (
    FAULTS,
    LIMITS,
    SETTINGS,
    SLOW,
    STATES,
    VOLTAGES,
    WITHIN_S,
    Cell,
    judged,
    reached,
)
from bench_trials.processes import children_of, is_stopped, is_there, words_of
from bench_trials.stand_in import MISBEHAVIOUR
from bench_trials.whole_run import WholeRun, code_of, first_of, hil_words, journal_faults, journal_of

from bender_hil.emulated import EmulatedBench
from bender_hil.guard.settings import GuardOrders
from bender_hil.supply.select import SupplySettings
from bender_loop.errors import RunError
from bender_studies.bench_trials.as_hardware import write_bench

SIGNALS = ("SIGKILL", "SIGSTOP", "SIGTSTP", "SIGQUIT", "SIGTERM", "SIGINT", "SIGHUP")
TARGETS = ("controller", "guard", "terminal")
FILES: dict[str, Callable[[Path], object]] = {
    "guard killed, rescue.jsonl taken": lambda folder: (folder / "rescue.jsonl").write_text("taken\n"),
    "guard killed, folder removed": lambda folder: shutil.rmtree(folder),
    "guard killed, folder a file": lambda folder: (shutil.rmtree(folder), folder.write_text("")),
}
NO_ROOM = ("disk full", "guard killed on a full disk")
NO_MEMORY = ("no memory left", "guard killed, no memory left")
"""The controller gets no more than it has."""
SPARES = ("guard and 1 spare killed", "guard and 2 spares killed", "guard and 1 spare stopped")
BOTH = {
    "guard and controller killed at once": 0.0,
    "guard killed 20 ms after the controller": 0.02,
    "guard killed 100 ms after the controller": 0.1,
    "guard killed 200 ms after the controller": 0.2,
}
"""Which process is killed first, and after how many seconds the other one; the watchman is left."""
STOPPED = "controller killed, guard stopped"

STREAMS: dict[str, Callable[[], object]] = {
    "standard output closed": lambda: os.close(1),
    "standard output stuck": lambda: _stuck_output(),
    "standard output read by nobody": lambda: _unread_output(),
}
"""How the standard output is when a run begins."""
STUCK = "output stuck on"
"""A fault of the supply, which comes to a run whose standard output is lost."""

_GUARD = b"bender_hil.guard\0"
_START_S = 20.0
_PATIENCE_S = 30.0
_NO_END = ("controller hangs", "controller stops in the middle of a line")
"""A stand-in that sleeps is not waited for."""


def process_faults() -> list[tuple[str, str]]:
    """All pairs of fault and state."""
    signals = [f"{name} to the {target}" for name in SIGNALS for target in TARGETS]
    found = list(itertools.product(signals, STATES))
    found += [(f"controller {what}", "holding") for what in MISBEHAVIOUR]
    found += list(itertools.product((*FILES, *SPARES, NO_ROOM[1]), ("rising", "holding", "descending")))
    found += list(itertools.product((*BOTH, STOPPED), ("rising", "holding", "descending")))
    found += list(itertools.product(NO_MEMORY, STATES))
    return [
        *found,
        (NO_ROOM[0], "holding"),
        *itertools.product((*STREAMS, *(f"{x}, {STUCK}" for x in STREAMS)), ("holding",)),
    ]


def run_process_cell(bench: EmulatedBench, fault: str, state: str, folder: Path) -> Cell:
    """Run one cell on an emulated bench that nobody else uses; leaves its supply as after the mains switch.

    Args:
        bench: running, of `fault_matrix.SETTINGS`.
        fault: one of `process_faults`.
        state: that stands there with it.
        folder: where a folder of the cell is made.

    Raises:
        RunError: the run does not reach its state.
    """
    bench.supply.make_ready()
    bench.supply.mend_sensor()
    place = folder / f"{fault}-{state}".replace(" ", "-").replace(",", "")
    place.mkdir(parents=True)
    trial = _Trial(bench, fault, state, place)
    try:
        return trial.run()
    finally:
        trial.close()


class _Trial:
    """One cell: the run, its guards, and what is seen of them from outside."""

    def __init__(self, bench: EmulatedBench, fault: str, state: str, place: Path) -> None:
        self._supply, self._fault, self._state, self._folder = bench.supply, fault, state, place / "run"
        if state == "opening":
            # so that it takes long enough to be disturbed
            self._supply.fault("delay_s", 0.02)
        self._run = WholeRun(
            self._words(bench, place),
            place,
            process_group=0,
            preexec_fn=_no_room if fault in NO_ROOM else STREAMS.get(fault.removesuffix(f", {STUCK}")),
        )
        self._family: set[int] = set()

    def run(self) -> Cell:
        """To its state, and through the fault."""
        controller = self._run.process.pid
        self._run.wait_for(self._supply, reached(self._state))
        self._note_family()
        guard = _guard_at_work(controller)
        fault_s = time.perf_counter()
        _do(self._fault, controller, guard, self._folder)
        if self._fault.endswith(STUCK):
            for name, value in FAULTS[STUCK]:
                self._supply.fault(name, value)
        off_s = self._run.watch(self._supply, self._is_over, WITHIN_S + 1.0)
        if self._fault == NO_ROOM[0]:
            # it is full some time after that
            trip = first_of(journal_of(self._folder), "trip")
            fault_s = fault_s if trip is None else trip["t"]
        status = self._run.end(0.1 if is_stopped(controller) or self._fault in _NO_END else _PATIENCE_S)
        cell = Cell(self._fault, self._state, "", None, "")
        truth = self._supply.truth()
        return judged(cell, self._run, status, self._folder, truth, off_s, fault_s, journal=self._journal_faults)

    def close(self) -> None:
        """Nothing of it is left, and the supply as after the mains switch."""
        self._note_family()
        for pid in self._family:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        self._run.end(0.0)
        self._supply.power_on()

    def _words(self, bench: EmulatedBench, place: Path) -> list[str]:
        asked = self._fault.removeprefix("controller ")
        limits = SLOW if self._state == "descending" else LIMITS
        if asked != self._fault:
            limits = replace(limits, heartbeat_s=0.4, frame_age_s=0.4)
        if asked not in MISBEHAVIOUR:
            return hil_words(write_bench(place, bench, SETTINGS, limits), VOLTAGES, self._folder)
        self._folder.mkdir()
        orders = GuardOrders(
            SupplySettings(self._supply.resource, timeout_s=0.1), str(self._folder / "guard.jsonl"), limits
        )
        return [stand_in.__file__, asked, orders.to_json()]

    def _note_family(self) -> None:
        known = {self._run.process.pid, *self._family}
        # the watchman starts a guard of its own
        self._family |= known.union(*(children_of(pid) for pid in known))

    def _is_over(self) -> bool:
        """Whether the controller has ended or is stopped, and no guard is at work any more."""
        self._note_family()
        controller = self._run.process
        is_lost = controller.poll() is not None or is_stopped(controller.pid)
        return is_lost and not any(_is_guard_at_work(pid) for pid in self._family)

    def _journal_faults(self, path: Path) -> list[str]:
        """No entry is missing, and a guard that was not lost has written its last one."""
        is_killed = self._fault in ("SIGKILL to the guard", "SIGSTOP to the guard")
        is_lost = is_killed or code_of(self._folder) in (None, "guard_gone") or self._fault in NO_ROOM
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
    elif fault in NO_MEMORY:
        _take_memory(controller)
        if fault != NO_MEMORY[0]:
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


def _guard_at_work(controller: int) -> int:
    """Return the guard of a controller, once it runs its own program; RunError where none comes."""
    end_s = time.perf_counter() + _START_S
    while time.perf_counter() < end_s:
        if found := _guards(controller):
            return found[0]
        time.sleep(0.005)
    raise RunError(f"process {controller} has no guard")


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


def _guards(pid: int) -> list[int]:
    """The guards that a controller has started; the watchman is none."""
    return [child for child in children_of(pid) if _GUARD in words_of(child)]


def _is_guard_at_work(pid: int) -> bool:
    return _GUARD in words_of(pid) and is_there(pid) and not is_stopped(pid)


def _take_memory(pid: int) -> None:
    """Leave a process what it has, and nothing more."""
    status = Path(f"/proc/{pid}/status").read_text()
    used = 1024 * int(next(x for x in status.splitlines() if x.startswith("VmSize")).split()[1])
    resource.prlimit(pid, resource.RLIMIT_AS, (used, used))


def _stuck_output() -> None:
    """Let the standard output be a pipe that is full, and that nobody reads."""
    with TemporaryDirectory() as folder:
        pipe = Path(folder) / "pipe"
        os.mkfifo(pipe)
        # one descriptor is both ends: it stays open as long as the process
        both = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(both, bytes(4096))
    os.set_blocking(both, True)
    os.dup2(both, 1)


def _unread_output() -> None:
    """Let nobody be left who reads the standard output."""
    reader, writer = os.pipe()
    os.dup2(writer, 1)
    os.close(reader)
    os.close(writer)


def _no_room() -> None:
    """Files of more than some 10 kB fail to be written, as on a full disk."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
