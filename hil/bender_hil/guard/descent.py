"""The way down: ramp to zero, output off, verified, and measured to be harmless. Every end of a run goes this way.

It may be called again at any time, it is bounded in time, and whatever fails on it is tried again over a fresh link.
"""

import math
import time
from dataclasses import dataclass

from bender_hil.guard.settings import GuardSettings
from bender_hil.log.journal import Journal
from bender_hil.supply.failures import SupplyError
from bender_hil.supply.source import Source

_RAMP_STEP_S = 0.005
_FOLLOW_S = 0.01
"""Between 0 V and output off: a supply that is on pulls its output down faster than one that is off."""
_PAUSE_S = 0.03
_POLL_S = 0.005


@dataclass(frozen=True, slots=True)
class Landing:
    """How the way down ended.

    Attributes:
        confirmed: the supply says that the output is off, and what is measured is harmless.
        off_s: `time.perf_counter` when the supply said so.
        harmless_s: when the measured voltage fell below the safe level.
        sentence: what is not as it should be.
    """

    confirmed: bool
    off_s: float | None = None
    harmless_s: float | None = None
    sentence: str = ""


def descend(source: Source, limits: GuardSettings, from_V: float, journal: Journal) -> Landing:
    """Bring the output from `from_V` to off."""
    end_s = time.perf_counter() + limits.shutdown_limit_s
    link_is_good = _ramp(source, limits, from_V, journal)
    off_s, sentence = _switch_off(source, end_s, link_is_good, journal)
    if off_s is None:
        return Landing(False, sentence=sentence)
    journal.write("output_off", off_s=off_s)
    return _discharge(source, limits, off_s, journal)


def _ramp(source: Source, limits: GuardSettings, from_V: float, journal: Journal) -> bool:
    """Go down at the ramp's rate without asking anything; returns whether the link held."""
    start_s = time.perf_counter()
    journal.write("ramp", from_V=from_V, rate_V_per_s=limits.ramp_V_per_s)
    try:
        while True:
            # the first step counts from one step before, so that the way down begins at once
            passed_s = time.perf_counter() - start_s + _RAMP_STEP_S
            left_V = max(0.0, abs(from_V) - limits.ramp_V_per_s * passed_s)
            source.set_voltage_blind(math.copysign(left_V, from_V))
            if left_V == 0.0:
                time.sleep(_FOLLOW_S)
                return True
            time.sleep(max(0.0, start_s + passed_s - time.perf_counter()))
    except SupplyError as error:
        journal.write("ramp_broken", sentence=str(error))
        return False


def _switch_off(source: Source, end_s: float, link_is_good: bool, journal: Journal) -> tuple[float | None, str]:
    """Output off until the supply confirms it; returns when it did, or None and why not."""
    sentence = ""
    for attempt in range(1_000_000):
        try:
            if attempt or not link_is_good:
                source.reopen()
                source.set_voltage_blind(0.0)
            source.off_blind()
            if source.confirm_off():
                return time.perf_counter(), ""
            sentence = "the supply says that its output is still on"
        except SupplyError as error:
            sentence = str(error)
        journal.write("not_confirmed", attempt=attempt, sentence=sentence)
        if time.perf_counter() + _PAUSE_S > end_s:
            break
        time.sleep(_PAUSE_S)
    return None, sentence


def _discharge(source: Source, limits: GuardSettings, off_s: float, journal: Journal) -> Landing:
    """Watch the terminals until what is left is harmless."""
    end_s = time.perf_counter() + limits.discharge_limit_s
    measured_V: float | None = None
    sentence = ""
    while time.perf_counter() < end_s:
        try:
            measured_V = source.measured_V()
        except SupplyError as error:
            sentence = str(error)
            measured_V = _reopened(source)
        else:
            if measured_V is None:
                return Landing(True, off_s)
        if measured_V is not None and abs(measured_V) < limits.safe_V:
            harmless_s = time.perf_counter()
            journal.write("harmless", measured_V=measured_V, below_V=limits.safe_V, after_off_s=harmless_s - off_s)
            return Landing(True, off_s, harmless_s)
        time.sleep(_POLL_S)
    if measured_V is not None:
        sentence = f"the output is off, but {measured_V:.2f} V are still measured"
    return Landing(False, off_s, sentence=sentence)


def _reopened(source: Source) -> None:
    try:
        source.reopen()
    except SupplyError:
        time.sleep(_PAUSE_S)
