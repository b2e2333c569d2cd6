"""A run as people have it, `bender hil` in a process of its own, and all that is seen of it from outside.

The emulated bench is driven as hardware is. What the run says, its exit status and its last line, is compared with the
truth behind the terminals; a run that was lost says nothing, and then somebody else has to.
"""

import contextlib
import math
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from bender_emulator.start import EmulatedSupply
from bender_hil.log.journal import read_journal
from bender_hil.log.read_run import GUARD, RUN
from bender_loop.errors import InputError, RunError
from bender_loop.shell.last_word import UNCONFIRMED, UNKNOWN
from bender_loop.shell.messages import Message
from bender_studies.bench_trials.as_hardware import HARMLESS_V

_REACHED_S, _LONGEST_S = 120.0, 40.0
"""Patient with a machine that does other things: starting a run is not what is tried."""
_OFF = "output off"
_LOST = (None, 0, 1, 2, 3, 130, 141)
"""Exit statuses that a run may have; None for one that a signal ended, or that had to be ended."""
_DISCHARGE_S = 1.5
_UNHURRIED_S = 30.0
"""For a run whose output is off to write its files and to end, on a machine that does other things."""

Reached = Callable[[Message], bool]
"""Whether a truth is that of the state in which a fault comes."""


class WholeRun:
    """One process, begun here.

    Args:
        words: that start it.
        folder: for what it says; there already.
        how: further keywords of Popen.

    Attributes:
        process: of the run.
        alarmed_s: `time.perf_counter` when an alarm stood on the standard error, None before.
    """

    def __init__(self, words: Sequence[str], folder: Path, **how: Any) -> None:
        self._printed, self._said = folder / "printed.txt", folder / "said.txt"
        with self._printed.open("wb") as printed, self._said.open("wb") as said:
            self.process = subprocess.Popen(
                [sys.executable, "-P", *words], stdin=subprocess.DEVNULL, stdout=printed, stderr=said, **how
            )
        self.alarmed_s: float | None = None

    def wait_for(self, supply: EmulatedSupply, is_reached: Reached) -> None:
        """Until the state is reached; RunError when the run ends before."""
        end_s = time.perf_counter() + _REACHED_S
        while not is_reached(supply.truth()):
            if self.process.poll() is not None or time.perf_counter() > end_s:
                raise RunError(f"the run did not reach its state: {self.said()[-300:]}")
            time.sleep(0.003)

    def watch(self, supply: EmulatedSupply, is_lost: Callable[[], bool], within_s: float) -> float | None:
        """Until the output is off and nobody is left who could switch it on; returns when it went off, None for never.

        Args:
            supply: whose truth counts.
            is_lost: whether the run has ended, or will never do anything again.
            within_s: how long an output stays on that nobody is left for, before that counts.
        """
        end_s, was_on = time.perf_counter() + _LONGEST_S, False
        given_up_s = None
        while time.perf_counter() < min(end_s, given_up_s or end_s):
            if self.alarmed_s is None and UNKNOWN in self.said():
                self.alarmed_s = time.perf_counter()
            truth, lost = supply.truth(), is_lost()
            was_on = was_on or truth["is_on"]
            if not truth["is_on"] and (was_on or lost):
                _wait_until_harmless(supply)
                return float(truth["switched_off_s"])
            given_up_s = (given_up_s or time.perf_counter() + within_s) if lost else None
            time.sleep(0.01)
        return None

    def end(self, timeout_s: float = _UNHURRIED_S) -> int | None:
        """Wait for its end; returns its exit status, None where a signal ended it or it had to be ended."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            status = self.process.wait(timeout=timeout_s)
            return status if status >= 0 else None
        self.process.kill()
        self.process.wait()
        return None

    def printed(self) -> str:
        """Its standard output so far."""
        return self._printed.read_text(errors="replace")

    def said(self) -> str:
        """Its standard error so far, with what its guard and its watchman said there."""
        return self._said.read_text(errors="replace")


def _wait_until_harmless(supply: EmulatedSupply) -> None:
    end_s = time.perf_counter() + _DISCHARGE_S
    while abs(float(supply.truth()["output_V"])) >= HARMLESS_V and time.perf_counter() < end_s:
        time.sleep(0.01)


def last_word_faults(status: int | None, printed: str, said: str, *, is_live: bool) -> list[str]:
    """Return what exit status and last lines say against the truth, and against each other.

    Args:
        status: None for a run that was lost; then it is enough that an alarm was given.
        printed: the standard output.
        said: the standard error.
        is_live: whether the output is on, or more than harmless.
    """
    last, last_said = _last_line(printed), _last_line(said)
    is_alarm = UNKNOWN in (said if status is None else last_said)
    faults = [f"exit status {status}"] if status not in _LOST else []
    if is_live and not is_alarm:
        faults.append(f"the output is on; status {status}, last lines {last!r} and {last_said!r}")
    if status is not None and (status == UNCONFIRMED) != is_alarm:
        faults.append(f"status {status}, and the last line is {last_said!r}")
    if is_alarm and last.endswith(_OFF):
        faults.append(f"an alarm, and {last!r}")
    if status == 0 and not last.endswith(_OFF):
        faults.append(f"status 0, and the last line is {last!r}")
    if "Traceback" in said + printed:
        faults.append("a traceback")
    return faults


def _last_line(text: str) -> str:
    return next((line.strip() for line in reversed(text.splitlines()) if line.strip()), "")


def journal_faults(journal: Path) -> list[str]:
    """What is wrong with a guard's journal: every entry is there, up to its last word."""
    try:
        last = list(read_journal(journal))[-1]["kind"]
    except (InputError, IndexError) as error:
        return [f"the journal is damaged: {error}"]
    return [] if last in ("end", "refused") else [f"the journal ends with {last!r}"]


def journal_of(run: Path, name: str = GUARD) -> list[dict[str, Any]]:
    """Return the entries of a journal, none where there is no sound one."""
    with contextlib.suppress(InputError):
        return list(read_journal(run / name))
    return []


def first_of(entries: Sequence[dict[str, Any]], kind: str) -> dict[str, Any] | None:
    """Return the first entry of that kind."""
    return next((entry for entry in entries if entry["kind"] == kind), None)


def code_of(run: Path) -> str | None:
    """Return why a run ended, by whoever had the last word of it; None for no reason, or no word."""
    stop = first_of(journal_of(run, RUN), "stop") or first_of(journal_of(run), "end")
    return None if stop is None else stop["code"]


def hil_words(bench: Path, voltages: Sequence[tuple[float, float]], out: Path) -> list[str]:
    """Return the words of a run through voltages, each from its time on; the last pair ends it."""
    return _words(bench, "voltage_V", voltages, out)


def following_words(bench: Path, gains: Path, setpoints: Sequence[tuple[float, float]], out: Path) -> list[str]:
    """Return the words of a loop through set-points with a gains file, each from its time on; the last pair ends it."""
    return [*_words(bench, "setpoint_um", setpoints, out), "--gains", str(gains)]


def _words(bench: Path, column: str, levels: Sequence[tuple[float, float]], out: Path) -> list[str]:
    profile = bench.with_name("profile.csv")
    rows = "".join(f"{time_s:g},{level:g}\n" for time_s, level in levels)
    profile.write_text(f"time_s,{column}\n{rows}", encoding="utf-8")
    return ["-m", "bender_cli", "hil", "--bench", str(bench), "--profile", str(profile), "--out", str(out)]


def has_stood(level_V: float, for_s: float) -> Reached:
    """Return whether the output, looked at again and again, reached a level so long ago.

    A fault that comes before any voltage stands leaves nothing to notice.
    """
    up_s = math.inf

    def is_reached(truth: Message) -> bool:
        nonlocal up_s
        if abs(float(truth["output_V"])) > 0.98 * level_V:
            up_s = min(up_s, time.perf_counter())
        return time.perf_counter() > up_s + for_s

    return is_reached


def is_live(truth: Message) -> bool:
    """Whether the output is on, or more than harmless."""
    return bool(truth["is_on"]) or abs(float(truth["output_V"])) >= HARMLESS_V
