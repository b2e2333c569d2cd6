"""The process in which an FMU is driven with the voltages of records, and what it does there.

It is told what to drive on standard input: it can be begun, and import what it needs, before there is an FMU.
"""

import contextlib
import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np

from bender_compiled.parallel_map import cores

if TYPE_CHECKING:
    from bender_loop.fmu.plant import FmuPlant
    from bender_loop.records.drive import InputHold

STEPS = "steps: "
"""How a line begins in which the process says how far it is."""
EVERY_S = 1.0


@dataclass(frozen=True, slots=True)
class _Child:
    """A process that waits to be told what to drive, and the file of what it says of problems."""

    process: "subprocess.Popen[str]"
    problems: IO[str]

    @classmethod
    def begun(cls) -> "_Child":
        """Return a new one."""
        problems = tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace")  # noqa: SIM115
        words, pipe = [sys.executable, "-P", "-m", __name__], subprocess.PIPE
        try:
            return cls(subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=problems, text=True), problems)
        except OSError:
            problems.close()
            raise

    def drive(self, words: Sequence[str], tell: Callable[[str], None] | None = None) -> str:
        """Have an FMU driven to the end; returns the last line of what went wrong, "" where nothing did.

        Args:
            words: the FMU, the input hold, the steps to a ramp and the records.
            tell: is told how far the child is.
        """
        assert self.process.stdin is not None
        with contextlib.suppress(BrokenPipeError), self.process.stdin as said:
            said.write(json.dumps(list(words)) + "\n")
        for line in self.process.stdout or ():
            if tell is not None and line.startswith(STEPS):
                tell(line.removeprefix(STEPS).strip())
        if not self.process.wait():
            return ""
        self.problems.seek(0)
        return next(reversed(self.problems.read().strip().splitlines()), f"status {self.process.returncode}")

    def end(self) -> None:
        """End the process, whatever it does."""
        self.process.kill()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        self.process.wait()
        self.problems.close()


class Driver:
    """Hands out a process that drives FMUs: one that was begun before, once, or a new one."""

    def __init__(self) -> None:
        self._ready: _Child | None = None

    def __enter__(self) -> "Driver":
        return self

    def __exit__(self, *_: object) -> None:
        if self._ready is not None:
            self._ready.end()

    def begin(self) -> None:
        """Begin a process that imports what it needs and waits, where a core may be free; once."""
        if self._ready is None and cores() > 1:
            with contextlib.suppress(OSError):
                self._ready = _Child.begun()

    @contextlib.contextmanager
    def child(self) -> Iterator[_Child]:
        """Hand out a process, which has ended after the block.

        Raises:
            OSError: none could be begun.
        """
        child, self._ready = self._ready or _Child.begun(), None
        try:
            yield child
        finally:
            child.end()


class _CountingPlant:
    """A plant that says once a second how many of its steps are done."""

    def __init__(self, plant: "FmuPlant", steps: int) -> None:
        self._plant, self._steps, self._done, self._next_s = plant, steps, 0, time.monotonic() + EVERY_S
        self.reset, self.read, self.close = plant.reset, plant.read, plant.close

    def step(self, voltage_V: float, step_s: float) -> float:
        """Advance the plant."""
        self._done += 1
        if not self._done % 1000 and time.monotonic() >= self._next_s:
            self._next_s = time.monotonic() + EVERY_S
            sys.stdout.write(f"{STEPS}{self._done}/{self._steps}\n")
            sys.stdout.flush()
        return self._plant.step(voltage_V, step_s)


def _wait_and_drive() -> int:
    """Import, wait for a line on standard input, drive what it names, and leave the readings beside the records."""
    from bender_loop.fmu.plant import FmuPlant
    from bender_loop.records.drive import drive_record, steps_of_drive
    from bender_loop.records.record import Record

    line = sys.stdin.readline()
    if not line:  # there is nothing to drive
        return 0
    fmu, hold, ramp_steps, *records = json.loads(line)
    known: InputHold = "linear" if hold == "linear" else "hold"
    for name in records:
        with np.load(name) as columns:
            record = Record(**columns)
        steps = steps_of_drive(record.time_s, record.voltage_V, record.command_time_s, known, int(ramp_steps))
        with FmuPlant(Path(fmu), start_s=float(record.time_s[0])) as plant:
            told = _CountingPlant(plant, steps)
            readings = drive_record(told, record, input_hold=known, ramp_steps=int(ramp_steps))
        np.save(Path(name).with_suffix(".npy"), readings)
    return 0


if __name__ == "__main__":
    # the terminal's Ctrl-C is for the process that this one drives for, which ends it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.exit(_wait_and_drive())
