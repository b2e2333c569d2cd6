"""The process that has an FMU in it: it does what the process in front of it asks, and ends with it."""

import contextlib
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from bender_loop.errors import InputError, RunError
from bender_loop.fmu.archive.bounds import MOST_BYTES
from bender_loop.fmu.controller import FmuController
from bender_loop.fmu.follower import Follower
from bender_loop.fmu.plant import FmuPlant
from bender_loop.fmu.ports import Port

STEPS, STOP = 0, 1
"""Places on the board that both processes see: steps that were finished, and whether to stop before the next."""
BOARD_BYTES = 16
SAID = "said.txt"
_MEMORY_SHARE, _LEAST_MEMORY_BYTES = 0.5, 2 << 30
_LOOK_S = 0.5


class StoppedError(Exception):
    """The process in front asked for an end between two steps."""


@dataclass(frozen=True, slots=True)
class Task:
    """What the process is started with.

    Attributes:
        path: the FMU.
        make: what it becomes there.
        options: of that.
        folder: all its files lie there: the board, what it says, the unpacked FMU.
        parent: number of the process in front.
    """

    path: Path
    make: "Callable[[Task, memoryview], Counted]"
    options: dict[str, Any]
    folder: Path
    parent: int


class CountedPlant(FmuPlant):
    """An FMU whose steps are counted on the board, and that stops there when it is told to."""

    def __init__(self, task: Task, board: memoryview) -> None:
        self._board = board
        super().__init__(task.path, **task.options)

    def ports(self) -> tuple[Port, Port]:
        """Return what takes the voltage and what is read."""
        return self.input, self.output

    def step(self, voltage_V: float, step_s: float) -> float:
        """Advance, unless an end is asked for."""
        if self._board[STOP]:
            raise StoppedError
        reading_um = super().step(voltage_V, step_s)
        self._board[STEPS] += 1
        return reading_um


class CountedController(FmuController):
    """A controller FMU whose steps are counted on the board."""

    def __init__(self, task: Task, board: memoryview) -> None:
        self._board = board
        super().__init__(task.path, **task.options)

    def step(self, setpoint_um: float, measurement_um: float, dt_s: float) -> float:
        """Take one sample."""
        command_V = super().step(setpoint_um, measurement_um, dt_s)
        self._board[STEPS] += 1
        return command_V


class CountedFollower(Follower):
    """A model-following controller whose steps are counted on the board."""

    def __init__(self, task: Task, board: memoryview) -> None:
        self._board = board
        super().__init__(task.path, **task.options)

    def step(self, aim_um: float, measured_um: float | None, dt_s: float, acted_s: float | None = None) -> float:
        """Take one sample."""
        command_V = super().step(aim_um, measured_um, dt_s, acted_s)
        self._board[STEPS] += 1
        return command_V


Counted = CountedPlant | CountedController | CountedFollower


def serve(connection: Connection, task: Task) -> None:
    """Answer requests until the connection ends."""
    _leave_signals_to_the_front()
    _limit_resources()
    _speak_into(task.folder / SAID)
    tempfile.tempdir = str(task.folder)
    threading.Thread(target=_end_with, args=(task,), daemon=True).start()
    try:
        _serve(connection, task)
    finally:
        shutil.rmtree(task.folder, ignore_errors=True)


def _serve(connection: Connection, task: Task) -> None:
    with (task.folder / "board").open("r+b") as file:
        board = _mapped(file.fileno())
    try:
        fmu = task.make(task, board)
    except Exception as error:
        connection.send((False, _portable(error)))
        return
    with fmu:
        connection.send((True, None))
        with contextlib.suppress(EOFError, OSError):
            while True:
                connection.send(_answer(fmu, *connection.recv()))


def mapped_board(path: Path) -> memoryview:
    """Create a board and return it."""
    path.write_bytes(bytes(BOARD_BYTES))
    with path.open("r+b") as file:
        return _mapped(file.fileno())


def _mapped(descriptor: int) -> memoryview:
    import mmap

    return memoryview(mmap.mmap(descriptor, BOARD_BYTES)).cast("Q")


def _answer(fmu: object, function: Any, args: tuple[Any, ...], kwargs: dict[str, Any]) -> tuple[bool, Any]:
    """Call a method of the FMU by its name, or a function with the FMU in front of its arguments."""
    try:
        call = getattr(fmu, function) if isinstance(function, str) else function
        return True, call(*(() if isinstance(function, str) else (fmu,)), *args, **kwargs)
    except Exception as error:
        return False, _portable(error)


def _portable(error: Exception) -> Exception:
    if isinstance(error, InputError | RunError | ValueError | StoppedError | MemoryError):
        return error
    return RunError(f"{type(error).__name__}: {error}")  # an access violation on Windows is an OSError


def _leave_signals_to_the_front() -> None:
    """An interrupt at the keyboard reaches every process of the terminal; what it means is decided in front."""
    ignored = [number for name in ("SIGINT", "SIGHUP") if (number := getattr(signal, name, None)) is not None]
    for number in ignored:
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {*ignored, signal.SIGTERM})


def _limit_resources() -> None:
    """At most half of the machine's memory, no file larger than an FMU, no memory dump; on POSIX only."""
    if sys.platform == "win32":
        return
    import resource

    whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    memory = max(_LEAST_MEMORY_BYTES, int(_MEMORY_SHARE * whole))
    for kind, wanted in (
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_FSIZE, MOST_BYTES),
        (resource.RLIMIT_CORE, 0),
    ):
        _, hard = resource.getrlimit(kind)
        most = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(kind, (most, most))


def _speak_into(path: Path) -> None:
    """What the FMU and the C library print goes into a file, of which the last line may be quoted."""
    said = os.open(path, os.O_CREAT | os.O_WRONLY | os.O_APPEND, 0o600)
    for stream in (1, 2):
        os.dup2(said, stream)
    os.close(said)


def _end_with(task: Task) -> None:
    """Leave no process and no files behind when the one in front was killed."""
    while os.getppid() == task.parent or sys.platform == "win32":
        time.sleep(_LOOK_S)
    shutil.rmtree(task.folder, ignore_errors=True)
    os._exit(1)
