"""Every fault of the emulated supply in every state of a run: a whole `bender hil`, and the truth behind the terminals.

What must hold in every cell: the run ends; where its exit status and its last line say that the output is off, nothing
is at the terminals; where it cannot say so, the last line is the alarm, with status 3; the one or the other within
`shutdown_limit_s` and a second of what ended the run; and the guard's journal has every line.
"""

import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bench_trials.whole_run import (
    Reached,
    WholeRun,
    code_of,
    first_of,
    following_words,
    has_stood,
    hil_words,
    is_live,
    journal_faults,
    journal_of,
    last_word_faults,
)

from bender_emulator.sensors.settings import TEXT
from bender_hil.emulated import EmulatedBench, EmulationSettings
from bender_hil.guard.settings import GuardSettings
from bender_hil.log.read_run import GUARD
from bender_loop.shell.last_word import UNCONFIRMED
from bender_loop.shell.messages import Message
from bender_studies.bench_trials.as_hardware import write_bench

STATES = ("opening", "armed", "rising", "holding", "descending")

FAULTS: dict[str, tuple[tuple[str, float | str], ...]] = {
    # answers
    "one answer missing": (("no_reply", 1),),
    "no answers": (("no_reply", "for ever"),),
    "answers 30 ms late": (("delay_s", 0.03),),
    "answers 80 ms late": (("delay_s", 0.08),),
    "answers 0.6 s late": (("delay_s", 0.6),),
    "one answer garbled": (("garble", 1),),
    "answers garbled": (("garble", "for ever"),),
    "one answer cut short": (("truncate", 1),),
    "answers cut short": (("truncate", "for ever"),),
    "answers without an end": (("no_end", 1),),
    "answers one question late": (("stale", 1),),
    "answers twice": (("twice", 1),),
    "a byte every 20 ms": (("drip_s", 0.02),),
    "a byte every 100 ms": (("drip_s", 0.1),),
    "a flood of lines": (("flood", "lines"),),
    "a flood without ends": (("flood", "bytes"),),
    "commands echoed": (("echo", 1),),
    "every answer 1e999": (("answer", "1e999"),),
    "every answer nan": (("answer", "nan"),),
    "every answer 0": (("answer", "0"),),
    "every answer a blank": (("answer", " "),),
    "every answer 3000 digits": (("answer", "7" * 3000),),
    "every answer 9000 digits": (("answer", "7" * 9000),),
    "every answer binary": (("answer", "\x00\xff\xfe"),),
    # the link
    "link drops": (("drop_link", 1),),
    "link drops at each of 3 questions": (("drops", 3),),
    "link drops at every question": (("drops", "for ever"),),
    "link drops and stays away": (("refuse", 1), ("drop_link", 1)),
    "merged writes cost the link": (("reset_on_merged_writes", 1),),
    "one line lost": (("lost_lines", 1),),
    "all lines lost": (("lost_lines", "for ever"),),
    # the instrument
    "instrument hangs": (("hung", 1),),
    "instrument hangs for 0.3 s": (("hung_s", 0.3),),
    "error in the queue": (("error", -200),),
    "error queue never empty": (("complaining", 1),),
    "protection trips": (("ovp_trip", 1),),
    "local key pressed": (("local", 1),),
    "switched off at the panel": (("panel_off", 1),),
    "set to 11 V at the panel": (("panel_V", 11.0),),
    "mains dip": (("mains_dip", 1),),
    "another instrument answers": (("other_model", "9116"), ("drop_link", 1)),
    "another unit of the model answers": (("other_unit", 1), ("drop_link", 1)),
    "another unit on the same link": (("other_unit", 1),),
    "settings without effect": (("deaf", 1),),
    "output goes off 0.3 s late": (("off_delay_s", 0.3),),
    "output stuck on": (("stuck_on", 1),),
    "output relay stuck": (("stuck_relay", 1),),
    # the terminals, and what is measured there
    "output 5 V off": (("offset_V", 5.0),),
    "leak of 50 mA": (("leak_A", 0.05),),
    "leak of -50 mA": (("leak_A", -0.05),),
    "current limit reached": (("limiting", 0.3),),
    "current reads -1e999 A": (("reading_A", "-1e999"),),
    "voltage reads 1e999 V": (("reading_V", "1e999"),),
    "voltage reads 0 V": (("reading_V", "0.0"),),
    "voltage reads 30 V": (("reading_V", "30.0"),),
}
"""What each fault does at the console, by the name that a table shows."""

LYING_RELAY = "output relay stuck"
"""Who says that it is off and lets nothing through at 0 V cannot be found out, and does no harm."""

LIMITS = GuardSettings(shutdown_limit_s=0.8, discharge_limit_s=1.0, heartbeat_s=0.3, frame_age_s=0.3)
SLOW = replace(LIMITS, ramp_V_per_s=1.0)
"""So that the way down takes long enough to be disturbed."""
WITHIN_S = LIMITS.shutdown_limit_s + 1.0
"""From what ended the run to the output off, or the alarm."""
SETTINGS = EmulationSettings(sensor=TEXT)
"""Of the bench behind every cell."""
_LEVEL_V = 30.0
_BEYOND = 1.1
VOLTAGES = ((0.0, 0.0), (0.3, 10.0), (0.35, 20.0), (0.4, _LEVEL_V), (0.9, _LEVEL_V))


BEFORE_ANY_VOLTAGE = ("opening", "armed", "zeroing")
"""States in which 0 V are commanded."""


@dataclass(frozen=True, slots=True)
class Cell:
    """What came of one fault in one state.

    Attributes:
        fault: its name.
        state: in which it came.
        outcome: "off" (verified), "alarm", "refused" before anything was switched on, or "on".
        code: why the run ended, None where no rule ended it.
        seconds: from what ended the run to the output off or the alarm; None where nothing was on.
        broken: what should not be; empty for a cell that is in order.
        status: of the run; None where it was lost.
        last_line: that it printed.
    """

    fault: str
    state: str
    outcome: str
    code: str | None
    broken: str
    seconds: float | None = None
    status: int | None = None
    last_line: str = ""


def cells() -> list[tuple[str, str]]:
    """All pairs of fault and state."""
    return list(itertools.product(FAULTS, STATES))


def reached(state: str) -> Reached:
    """Return whether a truth, one after the other, is that of a state."""
    match state:
        case "opening":
            return lambda truth: bool(truth["is_remote"])
        case "armed":
            return lambda truth: bool(truth["is_on"])
        case "rising":
            return has_stood(5.0, 0.0)
        case "holding":
            return has_stood(_LEVEL_V, 0.1)
    has_been_up = has_stood(_LEVEL_V, 0.0)
    return lambda truth: has_been_up(truth) and float(truth["output_V"]) < 0.95 * _LEVEL_V


Words = Callable[[Path, Path], list[str]]
"""Of a run up to the voltage of the states, by its bench file and its folder."""


def play_voltages(bench: Path, out: Path) -> list[str]:
    """Return the words of a run that plays voltages."""
    return hil_words(bench, VOLTAGES, out)


def follow_model(bench: Path, out: Path, *, gains: Path, um_per_V: float) -> list[str]:
    """Return the words of a run whose controller follows a model to where those voltages lead, and a little further."""
    beyond = [(time_s, _BEYOND * voltage_V * um_per_V) for time_s, voltage_V in VOLTAGES]
    return following_words(bench, gains, beyond, out)


def run_cell(bench: EmulatedBench, fault: str, state: str, folder: Path, *, words_of: Words = play_voltages) -> Cell:
    """Run one cell on an emulated bench that nobody else uses; leaves its supply as after the mains switch.

    Args:
        bench: running, of `SETTINGS`.
        fault: a key of `FAULTS`.
        state: one of `STATES`.
        folder: where a folder of the cell is made.
        words_of: says what is run.
    """
    supply = bench.supply
    supply.make_ready()
    supply.mend_sensor()
    place = folder / f"{fault}-{state}".replace(" ", "-").replace(".", "-")
    place.mkdir(parents=True)

    def spoil() -> None:
        for what, value in FAULTS[fault]:
            supply.fault(what, value)

    limits = SLOW if state == "descending" else LIMITS
    words = words_of(write_bench(place, bench, SETTINGS, limits), place / "run")
    if state == "opening":
        spoil()
    fault_s = time.perf_counter()
    run = WholeRun(words, place)
    try:
        if state != "opening":
            run.wait_for(supply, reached(state))
            fault_s = time.perf_counter()
            spoil()
        off_s = run.watch(supply, lambda: run.process.poll() is not None, within_s=0.1)
        status = run.end()
    finally:
        run.end(0.0)
    truth = supply.truth()
    supply.power_on()
    if fault == LYING_RELAY:
        truth["is_on"] = False
    cell = judged(Cell(fault, state, "", None, ""), run, status, place / "run", truth, off_s, fault_s)
    return cell if status is not None else replace(cell, broken=f"no end; {cell.broken}")


def judged(
    cell: Cell,
    run: WholeRun,
    status: int | None,
    folder: Path,
    truth: Message,
    off_s: float | None,
    fault_s: float,
    *,
    journal: Callable[[Path], list[str]] = journal_faults,
    is_timed: bool = True,
) -> Cell:
    """Return a cell with what came of it, told by what is at the terminals and by what the run said of that.

    Args:
        cell: its names.
        run: ended.
        status: of the run, None for one that was lost.
        folder: of the run.
        truth: behind the terminals, after the end.
        off_s: when the output went off, None where it did not.
        fault_s: when the fault came.
        journal: what is wrong with the guard's journal.
        is_timed: whether its limits are those of `LIMITS`.
    """
    entries, printed, said = journal_of(folder), run.printed(), run.said()
    live, opened = is_live(truth), first_of(entries, "opened")
    is_early = cell.state in BEFORE_ANY_VOLTAGE
    # what the fault took the journal from had begun: its state was waited for
    has_begun = first_of(entries, "armed") is not None or not (is_early or folder.is_dir())
    if not has_begun and not live and run.alarmed_s is None:
        outcome = "refused"
    else:
        outcome = "alarm" if run.alarmed_s is not None or status == UNCONFIRMED else "on" if live else "off"
    start_s = _began_s(entries, cell.state, fault_s)
    ends_s = [when_s for when_s in (run.alarmed_s, None if truth["is_on"] else off_s) if when_s is not None]
    # at 0 V nothing has to be switched off in haste
    is_harmless = outcome == "refused" or (outcome == "off" and is_early and not _volts_s(entries))
    seconds = None if is_harmless or not ends_s else max(0.0, min(ends_s) - start_s)
    faults = last_word_faults(status, printed, said, is_live=live)
    if is_timed and seconds is not None and seconds > WITHIN_S:
        faults.append(f"{seconds:.2f} s to the output off or the alarm")
    if outcome == "refused" and not is_early:
        faults.append("the run did not begin")
    if opened is not None or (folder / GUARD).exists():
        faults += journal(folder / GUARD)
    lines = [line for line in printed.splitlines() if line.strip()]
    return replace(
        cell,
        outcome=outcome,
        code=code_of(folder),
        broken="; ".join(faults),
        seconds=seconds,
        status=status,
        last_line=lines[-1] if lines else "",
    )


def _began_s(entries: list[dict[str, Any]], state: str, fault_s: float) -> float:
    """Return when what ended the run began: the fault, or the planned end where the run took no notice before."""
    if state in ("opening", "armed"):
        # some faults do not show without a voltage
        armed = [entry["t"] for entry in entries if entry["kind"] == "armed"]
        fault_s = max([fault_s, *(_volts_s(entries) or armed)[:1]])
    ramp = first_of(entries, "ramp")
    is_planned = ramp is not None and first_of(entries, "trip") is None
    return max(fault_s, ramp["t"]) if is_planned and ramp is not None else fault_s


def _volts_s(entries: list[dict[str, Any]]) -> list[float]:
    """Return when a voltage was applied."""
    return [entry["t"] for entry in entries if entry["kind"] == "applied" and entry["voltage_V"] != 0.0]
