"""The last line of a run: how it ended, and what a person should know before using it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from bender_hil.log.expectation import LOOPS
from bender_hil.log.read_run import RunLog
from bender_hil.log.summary import Summary
from bender_hil.runner.oscillation import OscillationWatch, Ranges
from bender_loop.control.metrics import StepMetrics

FEW = 0.01
"""A share of late, skipped or lost frames up to which a run still went as planned; they are counted all the same."""
WIDE_OVERSHOOT_PERCENT = 25.0
"""Beyond quarter decay's neighbour, the overshoot that most rules of tuning aim at."""
_OSCILLATED = "it oscillated"
MANY_SWINGS = 5
"""Swings that no move of the set-point explains; ten end the run."""


class EndOfRun(NamedTuple):
    """How a run ended.

    Attributes:
        code, sentence: of the rule that ended it, None where none did.
        alarm: loud words where the output could not be confirmed off, else empty.
        signal: that asked for the end, None where none did.
    """

    code: str | None
    sentence: str | None
    alarm: str
    signal: str | None


@dataclass(frozen=True, slots=True)
class Conduct:
    """What happened in a run.

    Attributes:
        remarks: what keeps it from having gone as planned.
        counts: what happened too seldom for that.
    """

    remarks: tuple[str, ...]
    counts: tuple[str, ...]


def conduct(summary: Summary, swings: int, step: StepMetrics | None, unexpected: Sequence[str] = ()) -> Conduct:
    """Return what a run's figures say against it.

    Args:
        summary: of the run.
        swings: that no move of the set-point explains.
        step: figures of its step, None where it had none.
        unexpected: what the command should have done and has not.
    """
    remarks, counts = list(unexpected), []
    if swings >= MANY_SWINGS:
        remarks.append(f"{_OSCILLATED} ({swings} swings that the set-point does not explain)")
    if step is not None and step.overshoot_percent > WIDE_OVERSHOOT_PERCENT:
        remarks.append(f"wide overshoot ({step.overshoot_percent:.0f} %)")
    for count, words in (
        (summary.late, f"{summary.late} of {summary.ticks} ticks late"),
        (summary.lost, f"{summary.lost} of {summary.ticks} readings without a tip"),
        (summary.skipped, f"{summary.skipped} readings skipped"),
        (summary.missing, f"{summary.missing} readings missing"),
    ):
        if count:
            (counts if count <= FEW * summary.ticks else remarks).append(words)
    if summary.clamped:
        counts.append(f"{summary.clamped} commands clamped by the guard")
    if not summary.ticks:
        remarks.append("not one reading led to a command")
    return Conduct(tuple(remarks), tuple(counts))


def count_swings(log: RunLog) -> int:
    """Return how many swings of a closed loop the set-point does not explain, at the worst moment of the run."""
    program, limits = log.start.get("program", {}), log.start.get("bench", {}).get("guard", {})
    if program.get("mode") not in LOOPS or not limits:
        return 0
    low_um, high_um = limits["travel_um"]
    watch = OscillationWatch(Ranges(high_um - low_um, limits["maximum_V"] - limits["minimum_V"]))
    for tick in log.ticks:
        watch.add(tick["setpoint_um"], tick["measured_um"], tick["command_V"])
    return watch.worst


def last_line(found: Conduct, end: EndOfRun) -> str:
    """Return how the run ended, in one line that never says "as planned" over something a person has to know."""
    remarks = [remark for remark in found.remarks if end.code != "oscillation" or not remark.startswith(_OSCILLATED)]
    told = ", ".join([*remarks, *found.counts])
    if end.alarm:
        return f"{end.alarm}{'; ' if told else ''}{told}"
    if end.signal is not None:
        start = f"interrupted by {end.signal}"
    elif end.code is not None:
        start = f"ended by a rule ({end.code}): {end.sentence}"
    else:
        start = "not as planned" if found.remarks else "as planned"
    return f"{start}{'; ' if told else ''}{told}; output off"
