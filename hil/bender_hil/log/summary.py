"""Figures of a run, from its journals: deadlines, delays, what was refused, how it ended."""

from dataclasses import dataclass

import numpy as np

from bender_hil.log.expectation import missing_frames
from bender_hil.log.journal import Entry
from bender_hil.log.read_run import RunLog


@dataclass(frozen=True, slots=True)
class Summary:
    """Figures of a run; delays in ms, NaN where there were no ticks.

    Attributes:
        ticks: frames that led to a command.
        skipped: frames that arrived and were passed over, because the loop was busy.
        late: ticks that were late, as `late_ticks` defines it.
        lost: frames without a tip.
        clamped: commands beyond the limits.
        slowed: commands that the slew limit held back.
        frame_to_command_ms: from grabbing a frame to its command on the wire: median, 99th percentile, maximum.
        emulated: whether the bench was.
        off_after_ms: from the reason for the end to the supply's word that the output is off.
        harmless_after_ms: the same to a measured voltage below the safe level.
        missing: frames that never came.
        late_ticks: their sequence numbers.
    """

    ticks: int
    skipped: int
    late: int
    lost: int
    clamped: int
    slowed: int
    frame_to_command_ms: tuple[float, float, float]
    emulated: bool
    off_after_ms: float | None
    harmless_after_ms: float | None
    missing: int = 0
    late_ticks: tuple[int, ...] = ()


def applied_times(log: RunLog) -> dict[int, float]:
    """Return when the first part of each command was on the wire, by the tick that it belongs to."""
    return {
        entry["sequence"]: entry["command_time_s"]
        for entry in reversed(log.guard)
        if entry["kind"] == "applied" and entry["whole"]
    }


def summarise(log: RunLog) -> Summary:
    """The figures of a run."""
    applied = applied_times(log)
    delays = [
        1e3 * (applied[tick["sequence"]] - tick["grabbed_s"]) for tick in log.ticks if tick["sequence"] in applied
    ]
    end = log.guard_entry("end") or {}
    began = log.guard_entry("ramp")
    off_s, harmless_s = end.get("off_s"), end.get("harmless_s")
    late = late_ticks(log)
    return Summary(
        ticks=len(log.ticks),
        skipped=sum(tick["skipped"] for tick in log.ticks[1:]),
        late=len(late),
        lost=sum(tick["measured_um"] is None for tick in log.ticks),
        clamped=int(end.get("clamped", 0)),
        slowed=int(end.get("slowed", 0)),
        frame_to_command_ms=_spread(delays),
        emulated=bool(log.start["emulated"]),
        off_after_ms=None if off_s is None or began is None else 1e3 * (off_s - began["t"]),
        harmless_after_ms=None if harmless_s is None or began is None else 1e3 * (harmless_s - began["t"]),
        missing=missing_frames(log),
        late_ticks=late,
    )


def late_ticks(log: RunLog) -> tuple[int, ...]:
    """Return the sequence numbers of the late ticks.

    A tick is late when its command was on the wire later than the deadline of the run after the instant of its reading,
    or was sent to the guard later than that, or was overtaken by the next one. The last commands of a run that ends in
    between are not: nothing overtook them.
    """
    applied, limit_s = applied_times(log), deadline_s(log)
    newest = max(applied, default=-1)
    return tuple(int(tick["sequence"]) for tick in log.ticks if _is_late(tick, applied, newest, limit_s))


def deadline_s(log: RunLog) -> float:
    """Return how long after the instant of a frame its command is late."""
    return float(log.start.get("deadline_s") or log.start.get("period_s") or np.inf)


def _is_late(tick: Entry, applied: dict[int, float], newest: int, limit_s: float) -> bool:
    sequence = tick["sequence"]
    if sequence in applied:
        return bool(tick["late"]) or applied[sequence] - tick["grabbed_s"] > limit_s
    was_overtaken = sequence < newest
    return bool(tick["late"]) or was_overtaken


def _spread(values: list[float]) -> tuple[float, float, float]:
    if not values:
        return (np.nan, np.nan, np.nan)
    return float(np.median(values)), float(np.percentile(values, 99.0)), float(np.max(values))
