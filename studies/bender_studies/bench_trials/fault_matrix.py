"""Every fault of the emulated supply in every state of a run: a real guard, a real link, and the truth behind it.

What must hold in every cell: the guard ends; where it says that the output is off, nothing is at the terminals; where
it cannot say so, the alarm is raised; the one or the other within `shutdown_limit_s` and a second of what ended the
run; and its journal has every line.
"""

import contextlib
import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bender_emulator.start import EmulatedSupply
from bender_hil.guard.guard import Status
from bender_hil.guard.settings import GuardOrders, GuardSettings
from bender_hil.guard.spares import Ended
from bender_hil.guard.start import GuardProcess, OutputUnknownError
from bender_hil.log.journal import read_journal
from bender_hil.supply.select import SupplySettings
from bender_loop.errors import InputError, RunError
from bender_loop.shell.messages import ClosedError, Message

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

_LYING_RELAY = "output relay stuck"

LIMITS = GuardSettings(shutdown_limit_s=0.8, discharge_limit_s=1.0, heartbeat_s=0.3, frame_age_s=0.3)
WITHIN_S = LIMITS.shutdown_limit_s + 1.0
"""From what ended the run to the output off, or the alarm."""
_TICK_S, _LONGEST_S = 0.02, 1.2
_HARMLESS_V = 1.0
_LEVEL_V = 30.0


@dataclass(frozen=True, slots=True)
class Cell:
    """What came of one fault in one state.

    Attributes:
        fault: its name.
        state: in which it came.
        outcome: "off" (verified), "alarm", or "refused" before anything was switched on.
        code: why the guard tripped, None where it did not.
        remaining_V: what is really at the terminals at the end.
        seconds: from what ended the run to the output off or the alarm; None where nothing was on.
        broken: what should not be; empty for a cell that is in order.
    """

    fault: str
    state: str
    outcome: str
    code: str | None
    remaining_V: float
    broken: str
    seconds: float | None = None


def cells() -> list[tuple[str, str]]:
    """All pairs of fault and state."""
    return list(itertools.product(FAULTS, STATES))


def run_cell(supply: EmulatedSupply, fault: str, state: str, folder: Path) -> Cell:
    """Run one cell on an emulated supply that nobody else uses; leaves it as after the mains switch.

    Args:
        supply: running.
        fault: a key of `FAULTS`.
        state: one of `STATES`.
        folder: the journal goes there.
    """
    supply.make_ready()
    name = f"{fault}-{state}".replace(" ", "-").replace(".", "-")
    journal = folder / f"{name}.jsonl"
    orders = GuardOrders(SupplySettings(supply.resource, baud=57600, timeout_s=0.1), str(journal), LIMITS)

    course = _Course(orders, state, lambda: [supply.fault(what, value) for what, value in FAULTS[fault]])
    outcome = "refused"
    try:
        ended = course.run()
        outcome = "off" if ended.status is not Status.UNCONFIRMED else "alarm"
    except OutputUnknownError:
        outcome = "alarm"
    except (InputError, RunError):
        pass
    done_s = time.perf_counter()
    truth = supply.truth()
    supply.power_on()
    seconds = _seconds(course, truth, outcome, done_s)
    if fault == _LYING_RELAY:
        # who says that it is off and lets nothing through at 0 V cannot be found out, and does no harm
        truth["is_on"] = False
    broken = _broken(outcome, course.ended, truth, journal, seconds)
    if outcome == "refused" and state != "opening":
        broken = f"the run did not begin; {broken}"
    code = None if course.ended is None else course.ended.code
    return Cell(fault, state, outcome, code, float(truth["output_V"]), broken, seconds)


class _Course:
    """One short run with the fault at its place.

    Attributes:
        ended: how the guard ended it.
        fault_s, stop_s: `time.perf_counter` of the fault and of the planned end.
        guard: None until it is ready.
    """

    def __init__(self, orders: GuardOrders, state: str, switch: Callable[[], object]) -> None:
        self._orders, self._state, self._switch = orders, state, switch
        self.ended: Ended | None = None
        self.guard: GuardProcess | None = None
        self.fault_s = self.stop_s = 0.0

    def run(self) -> Ended:
        """To its end."""
        if self._state == "opening":
            self._spoil()
        self.guard = guard = GuardProcess(self._orders)
        if self._state == "opening":
            # the fault waited while the guard's process was started; nothing was switched on before that
            self.fault_s = time.perf_counter()
        if self._state == "armed":
            self._spoil()
        with contextlib.suppress(ClosedError):
            self._drive(guard)
        self.ended = guard.wait()
        return self.ended

    def _drive(self, guard: GuardProcess) -> None:
        start_s = time.perf_counter()
        top_V = 0.0 if self._state == "armed" else _LEVEL_V
        for tick in range(round(_LONGEST_S / _TICK_S)):
            if guard.has_tripped():
                return
            level_V = min(top_V, 4.0 * tick)
            guard.command(tick, level_V, time.perf_counter(), 0.4 * level_V)
            if (self._state == "rising" and tick == 3) or (self._state == "holding" and tick == 15):
                self._spoil()
            if self._state == "descending" and tick == 12:
                guard.stop()
                self._spoil()
                self.stop_s = self.fault_s
                return
            time.sleep(max(0.0, start_s + (tick + 1) * _TICK_S - time.perf_counter()))
        self.stop_s = time.perf_counter()
        guard.stop()

    def _spoil(self) -> None:
        self.fault_s = time.perf_counter()
        self._switch()


def _seconds(course: _Course, truth: Message, outcome: str, done_s: float) -> float | None:
    """From what ended the run to the output off, by the supply's clock, or to the alarm, whichever came first."""
    guard = course.guard
    if guard is None:
        return None
    # where the fault ended the run, it counts from the fault, and so with the time to notice it
    start_s = course.stop_s or course.fault_s
    ends_s = [done_s] if outcome == "alarm" else []
    if guard.alarmed_s is not None:
        ends_s.append(guard.alarmed_s)
    if not truth["is_on"]:
        ends_s.append(float(truth["switched_off_s"]))
    return max(0.0, min(ends_s, default=done_s) - start_s)


def _broken(outcome: str, ended: Ended | None, truth: Message, journal: Path, seconds: float | None) -> str:
    faults = []
    if outcome != "alarm" and (truth["is_on"] or truth["output_V"] >= _HARMLESS_V):
        faults.append(f"{truth['output_V']:.2f} V are left and nobody says so")
    if outcome == "alarm" and ended is not None and not ended.alarm:
        faults.append("no alarm is raised")
    if seconds is not None and seconds > WITHIN_S:
        faults.append(f"{seconds:.2f} s to the output off or the alarm")
    return "; ".join([*faults, *journal_faults(journal)])


def journal_faults(journal: Path) -> list[str]:
    """What is wrong with a guard's journal: every entry is there, up to its last word."""
    try:
        last = list(read_journal(journal))[-1]["kind"]
    except (InputError, IndexError) as error:
        return [f"the journal is damaged: {error}"]
    return [] if last in ("end", "refused") else [f"the journal ends with {last!r}"]
