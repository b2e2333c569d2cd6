"""The rules that end a run, as a pure function of the situation."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from bender_hil.guard.settings import GuardSettings

_ABSURD_TIMES = 100.0
"""A reading so many times beyond what the supply is held to is no measurement: meter or limit has failed."""

_AHEAD_S = 0.01
"""A frame of a time to come would never be too old, so its clock is another one; all processes share this clock."""


class Trip(NamedTuple):
    """Why a run ends.

    Attributes:
        code: one word.
        sentence: what was found and what was allowed.
    """

    code: str
    sentence: str


@dataclass(slots=True)
class Situation:
    """What the guard knows; None is what it has not seen yet.

    Attributes:
        now_s, beat_s, frame_s: the time, that of the controller's last sign of life, that of its last frame.
        lost: frames in a row without a tip.
        tip_um: where the tip was last seen.
        lowest_V, highest_V: what the output was told within the settling time.
        measured_V: at the terminals.
        measured_A: what flows.
        high_for_s: from the first to the last of the newest readings above the limit; charging takes its time.
    """

    now_s: float = 0.0
    beat_s: float | None = None
    frame_s: float | None = None
    lost: int = 0
    tip_um: float | None = None
    lowest_V: float = 0.0
    highest_V: float = 0.0
    measured_V: float | None = None
    measured_A: float | None = None
    high_for_s: float = 0.0


def judge(limits: GuardSettings, seen: Situation) -> Trip | None:
    """The first rule that is broken, None when all is well."""
    silence_s = 0.0 if seen.beat_s is None else seen.now_s - seen.beat_s
    if silence_s > limits.heartbeat_s:
        return Trip("heartbeat", f"the controller was silent for {_ms(silence_s)}, allowed: {_ms(limits.heartbeat_s)}")
    age_s = 0.0 if seen.frame_s is None else seen.now_s - seen.frame_s
    if age_s < -_AHEAD_S:
        sentence = f"the newest reading is {_ms(-age_s)} ahead of now: its time is not one of time.perf_counter"
        return Trip("frame_age", sentence)
    if age_s > limits.frame_age_s:
        return Trip("frame_age", f"the newest reading is {_ms(age_s)} old, allowed: {_ms(limits.frame_age_s)}")
    if seen.lost > limits.lost_frames:
        return Trip("lost_tip", f"{seen.lost} readings in a row without a tip, allowed: {limits.lost_frames}")
    low_um, high_um = limits.travel_um
    if seen.tip_um is not None and not low_um <= seen.tip_um <= high_um:
        return Trip("travel", f"the tip is at {seen.tip_um:.2f} µm, allowed: {low_um:g} ... {high_um:g} µm")
    return judge_readings(limits, seen) or _judge_output(limits, seen)


def judge_readings(limits: GuardSettings, seen: Situation) -> Trip | None:
    """Return the trip for a reading that is not finite or absurd; no settling time has to be waited for."""
    for name, value, unit, held in (
        ("voltage", seen.measured_V, "V", limits.protection_V),
        ("current", seen.measured_A, "A", limits.current_limit_A),
    ):
        most = _ABSURD_TIMES * held
        if value is not None and not (math.isfinite(value) and abs(value) <= most):
            return Trip("reading", f"a {name} of {value:g} {unit} is measured, more than the possible {most:g} {unit}")
    return None


def _judge_output(limits: GuardSettings, seen: Situation) -> Trip | None:
    low_V, high_V = seen.lowest_V - limits.band_V, seen.highest_V + limits.band_V
    if seen.measured_V is not None and not low_V <= seen.measured_V <= high_V:
        return Trip("band", f"{seen.measured_V:.3f} V are measured, expected {low_V:.3f} ... {high_V:.3f} V")
    if seen.high_for_s > limits.settle_s:
        return Trip(
            "current",
            f"{seen.measured_A} A flow, allowed: {limits.current_trip_A:g} A for longer than {_ms(limits.settle_s)}",
        )
    return None


def _ms(time_s: float) -> str:
    return f"{1e3 * time_s:.0f} ms"
