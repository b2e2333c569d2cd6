"""The way down: ramp to zero, output off, verified, and measured to be harmless. Every end of a run goes this way.

"Off" is the word of the instrument that the run was opened with, and what is measured is believed only where that
instrument answers before and after; another one that answers at its address leaves the output unknown.

It may be called again at any time, and whatever fails on it is tried again over a fresh link. It has one deadline,
`shutdown_limit_s` from its start: the ramp takes at most `_RAMP_SHARE` of it, every answer is waited for until then at
most, and the terminals have `discharge_limit_s` after that. While it waits it calls `source.patience.waiting`.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bender_hil.guard.settings import GuardSettings
from bender_hil.log.journal import Journal
from bender_hil.supply.failures import WrongInstrumentError
from bender_hil.supply.source import Source

_RAMP_STEP_S = 0.005
_RAMP_SHARE = 0.4
"""The rest is for switching off, and for a spare guard, should this one be lost on the way."""
_FOLLOW_S = 0.01
"""Between 0 V and output off: a supply that is on pulls its output down faster than one that is off."""
_GAP_S = 0.01
"""After a command that nothing waits for: there are supplies that drop the link when two lines come in one packet."""
_PAUSE_S = 0.03
_POLL_S = 0.005
_WRITTEN_S = 0.05
"""Between two measurements of the discharge that are written down."""
_MOST_STEPS = 200
"""Of the ramp that are written down."""

Tell = Callable[..., Any]
"""Called as `tell("off", off_s=...)` and `tell("overdue", sentence=...)`; never raises."""


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


def tell_nobody(what: str, **facts: Any) -> None:
    """For a way down that nobody listens to."""


def descend(
    source: Source, limits: GuardSettings, from_V: float, journal: Journal, tell: Tell = tell_nobody
) -> Landing:
    """Bring the output from `from_V` to off; never raises.

    Args:
        source: opened, in whatever state.
        limits: with the deadlines.
        from_V: what the output was told last.
        journal: of the guard.
        tell: is told when the supply confirms that it is off, and when the terminals are live for too long.
    """
    start_s = time.perf_counter()
    end_s = source.patience.end_s = start_s + limits.shutdown_limit_s
    link_is_good, steps = _ramp(source, limits, from_V, journal)
    off_s, sentence = _switch_off(source, end_s, link_is_good, journal)
    if off_s is not None:
        journal.write("output_off", off_s=off_s)
        tell("off", off_s=off_s)
    # only now: what is written step by step would let a slow disk hold up the way down
    journal.write("came_down", steps=_thinned(steps))
    if off_s is None:
        return Landing(False, sentence=sentence)
    source.patience.end_s = off_s + limits.discharge_limit_s
    return _discharge(source, limits, off_s, end_s, journal, tell)


def ramp_rate_V_per_s(limits: GuardSettings, from_V: float) -> float:
    """Return the rate of the way down: `ramp_V_per_s`, or faster where that would take too long."""
    return max(limits.ramp_V_per_s, abs(from_V) / (_RAMP_SHARE * limits.shutdown_limit_s))


def _ramp(
    source: Source, limits: GuardSettings, from_V: float, journal: Journal
) -> tuple[bool, list[tuple[float, float]]]:
    """Go down without asking anything; returns whether the link held, and when which level was on the wire."""
    start_s = time.perf_counter()
    steps: list[tuple[float, float]] = []
    rate_V_per_s = ramp_rate_V_per_s(limits, from_V)
    journal.write("ramp", from_V=from_V, rate_V_per_s=rate_V_per_s)
    try:
        while True:
            # the first step counts from one step before, so that the way down begins at once
            passed_s = time.perf_counter() - start_s + _RAMP_STEP_S
            left_V = max(0.0, abs(from_V) - rate_V_per_s * passed_s)
            level_V = math.copysign(left_V, from_V)
            sent_s = source.set_voltage_blind(level_V)
            steps.append((sent_s, level_V))
            if left_V == 0.0:
                source.patience.pause(sent_s + _FOLLOW_S - time.perf_counter())
                return True, steps
            # a slow line is never given more than it carries: the switch must not wait behind the ramp
            source.patience.pause(max(start_s + passed_s, sent_s) - time.perf_counter())
    except Exception as error:  # whatever it is, the output has to go off
        journal.write("ramp_broken", sentence=_words(error))
        return False, steps


def _thinned(steps: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the steps of a ramp, not too many of them, the last one always."""
    stride = max(1, math.ceil(len(steps) / _MOST_STEPS))
    return steps[::-stride][::-1]


def _switch_off(source: Source, end_s: float, link_is_good: bool, journal: Journal) -> tuple[float | None, str]:
    """Output off until the supply confirms it; returns when it did, or None and why not.

    The switch comes before every question: a supply that answers late, in pieces or nonsense may still obey.
    """
    sentence = stranger = ""
    attempt = 0
    while True:
        try:
            if attempt or not link_is_good:
                source.reconnect()
                source.off_blind()
                source.patience.pause(_GAP_S)
                source.resync()
                source.set_voltage_blind(0.0)
                source.patience.pause(_GAP_S)
            source.off_blind()
            source.patience.pause(_GAP_S)
            if source.confirm_off():
                return time.perf_counter(), ""
            sentence, stranger = "the supply says that its output is still on", ""
        except WrongInstrumentError as error:
            sentence = stranger = _words(error)
        except Exception as error:  # as on the ramp
            # a question that the deadline cut off says nothing of the instrument
            is_cut_off = bool(sentence) and time.perf_counter() >= end_s
            sentence = stranger or (sentence if is_cut_off else _words(error))
        journal.write("not_confirmed", attempt=attempt, sentence=sentence)
        attempt += 1
        if time.perf_counter() + _PAUSE_S > end_s:
            return None, sentence
        source.patience.pause(_PAUSE_S)


def _discharge(
    source: Source, limits: GuardSettings, off_s: float, overdue_s: float, journal: Journal, tell: Tell
) -> Landing:
    """Watch the terminals until the remaining voltage is harmless; if it is not at `overdue_s`, say so."""
    sentence = "the output is off, but what is at the terminals could not be measured"
    stranger, was_told, written_s = "", False, -math.inf
    while time.perf_counter() < off_s + limits.discharge_limit_s:
        try:
            measured_V = source.measured_V()
            if measured_V is None:
                return Landing(True, off_s)
            harmless_s, stranger = time.perf_counter(), ""
            sentence = f"the output is off, but {measured_V:.2f} V are still measured"
            if abs(measured_V) < limits.safe_V:
                if source.confirm_off():
                    after_off_s = harmless_s - off_s
                    journal.write("harmless", measured_V=measured_V, below_V=limits.safe_V, after_off_s=after_off_s)
                    return Landing(True, off_s, harmless_s)
                sentence = "the output was off, and the supply says that it is on again"
                source.off_blind()
            elif harmless_s - written_s > _WRITTEN_S:
                written_s = harmless_s
                journal.write("discharging", measured_V=measured_V)
        except Exception as error:  # as on the ramp
            stranger = _reopen(source) or stranger
            sentence = f"the output is off, but its voltage is not known: {stranger or _words(error)}"
        if not was_told and time.perf_counter() > overdue_s:
            was_told = True
            journal.write("overdue", sentence=sentence)
            tell("overdue", sentence=sentence)
        source.patience.pause(_POLL_S)
    return Landing(False, off_s, sentence=sentence)


def _reopen(source: Source) -> str:
    """Open the link anew; returns who answers there where it is not the right instrument, else nothing."""
    try:
        source.reconnect()
        source.off_blind()
        source.resync()
    except Exception as error:  # as on the ramp
        # nothing is read from an instrument that is not known to be the right one
        source.close()
        source.patience.pause(_PAUSE_S)
        return _words(error) if isinstance(error, WrongInstrumentError) else ""
    return ""


def _words(error: Exception) -> str:
    return str(error) or type(error).__name__
