"""Every fault of the emulated supply in every state of a run: a real guard, a real link, and the truth behind it.

What must hold in every cell: the guard ends; where it says that the output is off, nothing is at the terminals; where
it cannot say so, the alarm is raised; and its journal has every line.
"""

import contextlib
import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bender_hil.emulator.start import EmulatedSupply
from bender_hil.guard.guard import Status
from bender_hil.guard.settings import GuardOrders, GuardSettings
from bender_hil.guard.start import Ended, GuardProcess, OutputUnknownError
from bender_hil.log.journal import read_journal
from bender_hil.supply.select import SupplySettings
from bender_hil.wire import ClosedError
from bender_loop.errors import InputError, RunError

STATES = ("opening", "armed", "rising", "holding", "descending")

FAULTS: dict[str, tuple[tuple[str, float | str], ...]] = {
    "one answer missing": (("no_reply", 1),),
    "no answers": (("no_reply", "for ever"),),
    "answers 30 ms late": (("delay_s", 0.03),),
    "answers 0.6 s late": (("delay_s", 0.6),),
    "one answer garbled": (("garble", 1),),
    "answers garbled": (("garble", "for ever"),),
    "one answer cut short": (("truncate", 1),),
    "answers cut short": (("truncate", "for ever"),),
    "answers one question late": (("stale", 1),),
    "link drops": (("drop_link", 1),),
    "link drops and stays away": (("refuse", 1), ("drop_link", 1)),
    "merged writes cost the link": (("reset_on_merged_writes", 1),),
    "instrument hangs": (("hung", 1),),
    "error in the queue": (("error", -200),),
    "protection trips": (("ovp_trip", 1),),
    "local key pressed": (("local", 1),),
    "settings without effect": (("deaf", 1),),
    "output stuck on": (("stuck_on", 1),),
    "output relay stuck": (("stuck_relay", 1),),
    "output 5 V off": (("offset_V", 5.0),),
    "leak of 50 mA": (("leak_A", 0.05),),
    "current limit reached": (("limiting", 0.3),),
}
"""What each fault does at the console, by the name that a table shows."""

LIMITS = GuardSettings(shutdown_limit_s=0.8, discharge_limit_s=1.0, heartbeat_s=0.3, frame_age_s=0.3)
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
        broken: what should not be; empty for a cell that is in order.
    """

    fault: str
    state: str
    outcome: str
    code: str | None
    remaining_V: float
    broken: str


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
    supply.power_on()
    name = f"{fault}-{state}".replace(" ", "-").replace(".", "-")
    journal = folder / f"{name}.jsonl"
    orders = GuardOrders(SupplySettings(supply.resource, baud=57600, timeout_s=0.1), str(journal), LIMITS)

    def switch() -> None:
        for what, value in FAULTS[fault]:
            supply.fault(what, value)

    ended: Ended | None = None
    outcome = "refused"
    try:
        ended = _course(orders, state, switch)
        outcome = "off" if ended.status is not Status.UNCONFIRMED else "alarm"
    except OutputUnknownError:
        outcome = "alarm"
    except (InputError, RunError):
        pass
    truth = supply.truth()
    supply.power_on()
    remaining_V = float(truth["output_V"])
    broken = _broken(outcome, ended, remaining_V, journal)
    return Cell(fault, state, outcome, ended.code if ended is not None else None, remaining_V, broken)


def _course(orders: GuardOrders, state: str, switch: Callable[[], None]) -> Ended:
    """One short run with the fault at its place."""
    if state == "opening":
        switch()
    guard = GuardProcess(orders)
    if state == "armed":
        switch()
    start_s = time.perf_counter()
    top_V = 0.0 if state == "armed" else _LEVEL_V
    with contextlib.suppress(ClosedError):
        for tick in range(round(_LONGEST_S / _TICK_S)):
            if guard.has_tripped():
                break
            level_V = min(top_V, 4.0 * tick)
            guard.command(tick, level_V, time.perf_counter(), 0.4 * level_V)
            if (state == "rising" and tick == 3) or (state == "holding" and tick == 15):
                switch()
            if state == "descending" and tick == 12:
                guard.stop()
                switch()
                break
            time.sleep(max(0.0, start_s + (tick + 1) * _TICK_S - time.perf_counter()))
        else:
            guard.stop()
    return guard.wait()


def _broken(outcome: str, ended: Ended | None, remaining_V: float, journal: Path) -> str:
    faults = []
    if outcome != "alarm" and remaining_V >= _HARMLESS_V:
        faults.append(f"{remaining_V:.2f} V are left and nobody says so")
    if outcome == "alarm" and ended is not None and not ended.alarm:
        faults.append("no alarm is raised")
    try:
        last = list(read_journal(journal))[-1]["kind"]
    except (InputError, IndexError) as error:
        faults.append(f"the journal is damaged: {error}")
    else:
        if last not in ("end", "refused"):
            faults.append(f"the journal ends with {last!r}")
    return "; ".join(faults)
