"""Bad inputs through whole commands, each in a process and a folder of its own, with a limit of time and memory."""

import contextlib
import json
import multiprocessing
import os
import random
import re
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bender_loop.fmu.process.watched import NATIVE_CODE
from fuzzing.hostile_words import Sound, made_case
from fuzzing.program import installed

SECONDS = 240.0
"""For one input, on a machine that does other things at the same time."""
PATIENCE_S = 8.0
"""Of the processor: what was accepted may compute for longer, and is then interrupted as by Ctrl-C."""
BAD_INPUT, ALARMED, INTERRUPTED = 2, 3, 130
_STATUSES = {0, 1, BAD_INPUT, INTERRUPTED}
WHOLE = 20
"""One in so many is run by an interpreter of its own, as people do; the others are forked off."""
_MEMORY_BYTES = 8 << 30
_PROGRESS = re.compile(r"[\w -]+: \d+(/\d+)?(, .*)?|[^:]+, \d+ s|\d\d-[\w-]+: .* \(\d+ s\)")
"""How far a command is, and what an investigation is about to play."""
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
        noise: inputs with --json whose output is no document.
        failed: what was said of inputs with exit status 1; no complaint, and to be looked at.
    """

    tried: int = 0
    statuses: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    hangs: list[str] = field(default_factory=list)
    left: list[str] = field(default_factory=list)
    noise: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)

    @property
    def complaints(self) -> list[str]:
        """All of them."""
        return [*self.faults, *self.hangs, *self.left, *self.noise]


def try_inputs(
    fmu: Path,
    inputs: int,
    seed: int,
    processes: int,
    tell: Callable[[Tally, int], None],
    seconds: float = SECONDS,
    only: Sequence[int] | None = None,
) -> Tally:
    """Try inputs 0 to `inputs` - 1 of a seed, or `only` some; the same seed gives the same inputs."""
    tally, sound = Tally(), Sound(fmu.read_bytes())
    context = _context()
    waiting, running = list(only or range(inputs))[::-1], []
    with tempfile.TemporaryDirectory(prefix="bender-inputs-") as place:
        while waiting or running:
            while waiting and len(running) < processes:
                running.append(_Running(context, waiting.pop(), Path(place), seed, sound, seconds))
            for one in [one for one in running if one.has_ended()]:
                running.remove(one)
                one.judge(tally)
                tell(tally, inputs)
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
        self.process = context.Process(target=_run, args=(self.words, self.folder, k % WHOLE == WHOLE - 1))
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
        status, said = self.process.exitcode, self._read("said.txt")
        about = f"input {self.k} ({self.wrong}): bender {' '.join(x[:60] for x in self.words)}"
        tally.tried += 1
        tally.statuses[str(status)] += 1
        if status == 1:
            tally.failed.append(f"{about}: {said.strip()[-200:]}")
        # a machine that is slow tells its progress beside the sentence
        sentences = [
            line for line in said.splitlines() if line and not _PROGRESS.fullmatch(line) and line != NATIVE_CODE
        ]
        if status == 1:
            # what was said before a bench failed is no second sentence on the failure
            sentences = [line for line in sentences if not line.startswith("note: ")]
        if self.seconds == 0.0:
            tally.hangs.append(f"{about}: no end; it said last: {said.strip().rpartition(chr(10))[2][-100:]}")
        elif status not in _STATUSES | ({ALARMED} if self.words[0] == "watch" else set()) or any(
            words in said for words in _FAULT
        ):
            tally.faults.append(f"{about}: exit status {status}: {said.strip()[-300:]}")
        elif (status == BAD_INPUT and len(sentences) != 1) or (status == 1 and len(sentences) > 1):
            tally.faults.append(f"{about}: exit status {status}, said in {len(sentences)} lines: {said.strip()[-300:]}")
        elif "--json" in self.words and not _is_one_document(printed := self._read("printed.txt")):
            tally.noise.append(f"{about}: exit status {status}: printed {printed[:200]!r}")
        asked = {x.partition("=")[2] for x in self.words if x.startswith("--log=")}
        kept = {"said.txt", "printed.txt", *asked, *(f"work/{x}" for x in asked)}
        new = sorted(_listed(self.folder) - self.before - kept)
        # locks of a bench stay: whoever comes next takes them
        new = [x for x in new if not x.startswith("temporary/bender-hil-")]
        scraps = [x for x in new if x.endswith(".tmp") or x.startswith("temporary/")]
        if self.seconds and (scraps or (status == BAD_INPUT and new)):
            tally.left.append(f"{about}: left {', '.join(new[:5])}")

    def _read(self, name: str) -> str:
        with contextlib.suppress(OSError):
            return (self.folder / name).read_text(encoding="utf-8", errors="replace")
        return ""


def _is_one_document(printed: str) -> bool:
    """Whether what was printed with --json is nothing, or one document whose numbers JSON has."""

    def refuse(name: str) -> None:
        raise ValueError(name)

    try:
        json.loads(printed or "null", parse_constant=refuse)
    except (ValueError, RecursionError):
        return False
    return True


def _listed(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


def _context() -> Any:
    """Forked off a process that has the libraries loaded, where the platform can do that."""
    if os.name != "posix":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(_HEAVY))
    return context


def _run(words: list[str], folder: Path, is_whole: bool) -> None:
    """Run one command line as its own process would, or, where `is_whole`, as its own process."""
    if os.name == "posix":
        import resource

        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    for stream, name in ((1, "printed.txt"), (2, "said.txt")):
        with (folder / name).open("wb") as file:
            os.dup2(file.fileno(), stream)
    sys.stdout = open(1, "w", encoding="utf-8", errors="replace", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", encoding="utf-8", errors="replace", closefd=False)  # noqa: SIM115
    if hasattr(signal, "setitimer"):
        # as Ctrl-C and no other way: compiled code holds that one back; in the background it would be ignored
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGPROF, lambda *_: signal.raise_signal(signal.SIGINT))
        signal.setitimer(signal.ITIMER_PROF, PATIENCE_S)
    os.environ |= dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(folder / "temporary"))
    tempfile.tempdir = str(folder / "temporary")
    os.chdir(folder / "work")
    if is_whole:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_PROF, 0.0)
        os.execv(sys.executable, [sys.executable, "-P", "-m", installed().__package__ or "", *words])
    status = installed().main(words)
    sys.stdout.flush()
    sys.stderr.flush()
    sys.exit(status)
