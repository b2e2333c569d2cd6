"""Bad inputs through whole commands, each in a process and a folder of its own, with a limit of time and memory."""

import contextlib
import multiprocessing
import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fuzzing.hostile_words import Sound, made_case
from fuzzing.program import installed

SECONDS = 60.0
BAD_INPUT, INTERRUPTED = 2, 130
_MEMORY_BYTES = 8 << 30
_FAULT = ("a fault in bender itself", "Traceback (most recent call last)")
_HEAVY = (
    "fuzzing.hostile_words",
    "bender_loop.fmu.plant",
    "bender_export.build",
    "bender_tuner.task.session",
)


@dataclass(slots=True)
class Tally:
    """What came of the inputs.

    Attributes:
        tried: how many.
        statuses: how many ended with which exit status.
        faults: exceptions, ends by a signal, sentences that are not one, each with its words.
        hangs: inputs that took longer than the limit.
        left: inputs that were refused, with files left behind.
    """

    tried: int = 0
    statuses: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    hangs: list[str] = field(default_factory=list)
    left: list[str] = field(default_factory=list)

    @property
    def complaints(self) -> list[str]:
        """All of them."""
        return [*self.faults, *self.hangs, *self.left]


def try_inputs(
    fmu: Path, inputs: int, seed: int, processes: int, tell: Callable[[int, int], None], seconds: float = SECONDS
) -> Tally:
    """Try inputs 0 to `inputs` - 1 of a seed; the same seed gives the same inputs."""
    tally, sound = Tally(), Sound(fmu.read_bytes())
    context = _context()
    waiting, running = list(range(inputs))[::-1], []
    with tempfile.TemporaryDirectory(prefix="bender-inputs-") as place:
        while waiting or running:
            while waiting and len(running) < processes:
                running.append(_Running(context, waiting.pop(), Path(place), seed, sound, seconds))
            for one in [one for one in running if one.has_ended()]:
                running.remove(one)
                one.judge(tally)
                tell(tally.tried, inputs)
            time.sleep(0.01)
    return tally


class _Running:
    """One input on its way."""

    def __init__(self, context: Any, k: int, place: Path, seed: int, sound: Sound, seconds: float) -> None:
        self.folder = place / str(k)
        (self.folder / "work").mkdir(parents=True)
        (self.folder / "temporary").mkdir()
        self.words, self.wrong = made_case(k, self.folder / "work", random.Random(f"{seed} input {k}"), sound)
        self.before = _listed(self.folder)
        self.k, self.seconds, self.began_s = k, seconds, time.monotonic()
        self.process = context.Process(target=_run, args=(self.words, self.folder))
        self.process.start()

    def has_ended(self) -> bool:
        """Whether it is over, which it is at the latest when its time is."""
        if self.process.is_alive() and time.monotonic() - self.began_s > self.seconds:
            with contextlib.suppress(OSError):
                os.killpg(self.process.pid or 0, signal.SIGKILL)
            self.process.kill()
            self.process.join()
            self.seconds = 0.0
        return not self.process.is_alive()

    def judge(self, tally: Tally) -> None:
        """Count what came of it."""
        self.process.join()
        status, said = self.process.exitcode, self._said()
        about = f"input {self.k} ({self.wrong}): bender {' '.join(x[:60] for x in self.words)}"
        tally.tried += 1
        tally.statuses[str(status)] += 1
        lines = [line for line in said.splitlines() if line.startswith("bender")]
        if self.seconds == 0.0:
            tally.hangs.append(f"{about}: no end; it said last: {said.strip().rpartition(chr(10))[2][-100:]}")
        elif status not in (0, 1, BAD_INPUT, INTERRUPTED) or any(words in said for words in _FAULT):
            tally.faults.append(f"{about}: exit status {status}: {said.strip()[-300:]}")
        elif (status == BAD_INPUT and len(said.splitlines()) != 1) or (status == 1 and len(lines) > 1):
            tally.faults.append(f"{about}: said in {len(said.splitlines())} lines: {said.strip()[-300:]}")
        new = sorted(_listed(self.folder) - self.before - {"said.txt", "printed.txt"})
        scraps = [name for name in new if name.endswith(".tmp") or name.startswith("temporary")]
        if self.seconds and (scraps or (status == BAD_INPUT and new)):
            tally.left.append(f"{about}: left {', '.join(new[:5])}")

    def _said(self) -> str:
        with contextlib.suppress(OSError):
            return (self.folder / "said.txt").read_text(encoding="utf-8", errors="replace")
        return ""


def _listed(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


def _context() -> Any:
    """Forked off a process that has the libraries loaded, where the platform can do that."""
    if os.name != "posix":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(_HEAVY))
    return context


def _run(words: list[str], folder: Path) -> None:
    """Run one command line as its own process would."""
    if os.name == "posix":
        import resource

        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    for stream, name in ((1, "printed.txt"), (2, "said.txt")):
        with (folder / name).open("wb") as file:
            os.dup2(file.fileno(), stream)
    sys.stdout = open(1, "w", encoding="utf-8", errors="replace", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", encoding="utf-8", errors="replace", closefd=False)  # noqa: SIM115
    os.environ |= dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(folder / "temporary"))
    tempfile.tempdir = str(folder / "temporary")
    os.chdir(folder / "work")
    status = installed().main(words)
    sys.stdout.flush()
    sys.stderr.flush()
    sys.exit(status)
