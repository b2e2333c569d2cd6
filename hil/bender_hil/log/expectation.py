"""What a run should have looked like: the tip follows the command, set-points are reached, a still loop stays still.

The rules of a run end it when something is dangerous. What is judged here is only wrong: a gain with the other sign, a
recording in the place of the picture, a tip that sticks, a wire that creeps away. Nothing is expected where the command
has hardly moved, and nothing of the direction where the bench file expects no response.
"""

import math
from collections import deque
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_hil.log.read_run import RunLog

Array = NDArray[np.float64]

NOISE_UM = 0.15
"""Beyond any noise of the tip that a run is started with."""
REACHED_SHARE = 0.05
"""Of the step: an error of the last tenth of a run up to which the set-point counts as reached."""
FOLLOWS = 0.3
"""Share of the tip's variance that the command explains at the least, at the best delay."""
MISSED_SHARE = 0.5
"""Of the set-points' own scatter: what a loop misses of moving set-points, at the best delay, beyond which it has not
followed them."""
RESTING_UM = 6.0 * NOISE_UM
"""A tip that stays within this has not moved."""
CREEP_SHARE = 0.5
"""Of the stroke: a drift over the whole run beyond which the picture of an open loop creeps away."""
_TELLS_APART = 0.5
"""Share of the command that time explains; above it, a drift cannot be told from what the command does."""
LONGEST_DELAY_S = 0.5
LOOPS = ("closed_loop", "model_following", "controller_fmu")
"""Modes of a run in which a controller follows set-points."""
_FEWEST_TICKS = 20
_TAIL = 0.1
_DRIFT_SHARE, _STEADY = 0.05, 0.7
"""A drift of a still loop's command: of the range, and so steady (creep of the material slows down with log time)."""


def unexpected_behaviour(log: RunLog) -> list[str]:
    """Return what a run's ticks say against it, a sentence each; of a run that is too short, nothing."""
    bench, program = log.start.get("bench", {}), log.start.get("program", {})
    ticks = [tick for tick in log.ticks if tick["measured_um"] is not None]
    if len(ticks) < _FEWEST_TICKS or not bench.get("controller"):
        return []
    time_s, tip_um, command_V = (_column(ticks, name) for name in ("grabbed_s", "measured_um", "command_V"))
    time_s = time_s - time_s[0]
    aim_um = _column(ticks, "setpoint_um")
    is_loop = program.get("mode") in LOOPS and _has_feedback(program)
    of_loop = _of_a_loop(time_s, tip_um, command_V, aim_um, bench.get("guard", {})) if is_loop else None
    if of_loop == []:
        # a loop that has reached its set-point has shown which way the tip goes
        return []
    return _against_the_command(time_s, tip_um, command_V, bench["controller"]) + (of_loop or [])


def _has_feedback(program: dict[str, Any]) -> bool:
    """Whether the controller looks at the tip; the inverse of a model alone reaches what its model allows."""
    gains = program.get("gains")
    return gains is None or any(value for name, value in gains.items() if name.endswith(("_um", "_um_s", "_per_um")))


def missing_frames(log: RunLog) -> int:
    """Return how many frames never came: gaps between frames, less those that the loop passed over."""
    period_s = float(log.start.get("period_s") or math.inf)
    grabbed_s = np.array([tick["grabbed_s"] for tick in log.ticks])
    skipped = np.array([tick["skipped"] for tick in log.ticks[1:]])
    gaps = np.rint(np.diff(grabbed_s) / period_s) - 1.0 - skipped if len(grabbed_s) > 1 else np.zeros(0)
    return int(np.sum(np.maximum(gaps, 0.0)))


def _column(ticks: list[dict[str, Any]], name: str) -> Array:
    return np.array([math.nan if tick[name] is None else float(tick[name]) for tick in ticks])


def _against_the_command(time_s: Array, tip_um: Array, command_V: Array, expected: dict[str, Any]) -> list[str]:
    response_um_per_V, slack_V = float(expected["response_um_per_V"]), float(expected["slack_V"])
    gone_V = float(np.ptp(command_V))
    if response_um_per_V * (gone_V - slack_V) <= 2.0 * NOISE_UM:
        return []
    # a run begins at rest at 0 V, and so does a command that acts later: without its rest, a tip that swings back from
    # an overshoot would seem to go against it
    later_V = [np.concatenate((np.zeros(k), command_V[: len(tip_um) - k])) for k in _delays(time_s)]
    shares, slopes = zip(*(_line(acting_V, tip_um) for acting_V in later_V), strict=True)
    best = int(np.argmax(shares))
    if shares[best] < FOLLOWS:
        return [f"the tip does not follow the command (which explains {100.0 * shares[best]:.0f} % of its motion)"]
    if slopes[best] < 0.0:
        return [f"the tip moves against the command ({slopes[best]:.2f} µm/V)"]
    return _stuck(time_s, tip_um, command_V, expected) or _creeping(time_s, tip_um, later_V[best])


def _creeping(time_s: Array, tip_um: Array, acting_V: Array) -> list[str]:
    """Return whether the tip runs away by itself, without slowing down, beside what the command moves."""
    times_s = time_s - time_s.mean()
    if _line(times_s, acting_V)[0] > _TELLS_APART:
        return []
    equations = np.column_stack((acting_V, times_s, np.ones_like(times_s)))
    slope_um_per_V, rate_um_per_s, _ = np.linalg.lstsq(equations, tip_um, rcond=None)[0].tolist()
    if abs(rate_um_per_s) * float(np.ptp(times_s)) <= CREEP_SHARE * abs(slope_um_per_V) * float(np.ptp(acting_V)):
        return []
    halves = (np.array_split(x, 2) for x in (times_s, tip_um - slope_um_per_V * acting_V))
    first_um, second_um = (_run(*half) for half in zip(*halves, strict=True))
    if second_um * first_um <= 0.0 or abs(second_um) < _STEADY * abs(first_um):
        return []
    return [f"the tip drifts by {rate_um_per_s:+.2f} µm/s whatever the command: it creeps, or what looks at it moves"]


def _stuck(time_s: Array, tip_um: Array, command_V: Array, expected: dict[str, Any]) -> list[str]:
    """Return whether the tip rested somewhere while the command went so far that it must have moved."""
    response_um_per_V, slack_V = float(expected["response_um_per_V"]), float(expected["slack_V"])
    if response_um_per_V * (float(np.ptp(command_V)) - slack_V) <= RESTING_UM:
        return []
    for begin, end in _rests(tip_um):
        # what was commanded at the end of a rest moves the tip after it
        acting = slice(begin, int(np.searchsorted(time_s, time_s[end - 1] - LONGEST_DELAY_S)))
        gone_V = float(np.ptp(command_V[acting])) if acting.stop > begin else 0.0
        if response_um_per_V * (gone_V - slack_V) > RESTING_UM:
            since_s, until_s = float(time_s[begin]), float(time_s[end - 1])
            return [
                f"the tip did not move from {since_s:.1f} to {until_s:.1f} s, while the command went {gone_V:.1f} V"
            ]
    return []


def _rests(tip_um: Array) -> Iterator[tuple[int, int]]:
    """Yield the longest stretches in which the tip stays within `RESTING_UM`, each that ends later than all before."""
    lowest, highest = deque[int](), deque[int]()
    begin = 0
    for k, place_um in enumerate(tip_um.tolist()):
        was_resting = begin
        for extremes, sign in ((lowest, 1.0), (highest, -1.0)):
            while extremes and sign * tip_um[extremes[-1]] >= sign * place_um:
                extremes.pop()
            extremes.append(k)
        while tip_um[highest[0]] - tip_um[lowest[0]] > RESTING_UM:
            begin += 1
            for extremes in (lowest, highest):
                if extremes[0] < begin:
                    extremes.popleft()
        if begin != was_resting:
            yield was_resting, k
    yield begin, len(tip_um)


def _delays(time_s: Array) -> range:
    period_s = float(np.median(np.diff(time_s)))
    most = min(len(time_s) // 2, math.ceil(LONGEST_DELAY_S / max(period_s, 1e-3)))
    return range(most + 1)


def _line(command_V: Array, tip_um: Array) -> tuple[float, float]:
    """Return which share of the tip's variance a straight line explains, and its slope."""
    variance_V2, variance_um2 = float(np.var(command_V)), float(np.var(tip_um))
    if variance_V2 <= 0.0 or variance_um2 <= 0.0:
        return 0.0, 0.0
    covariance = float(np.mean((command_V - command_V.mean()) * (tip_um - tip_um.mean())))
    return covariance**2 / (variance_V2 * variance_um2), covariance / variance_V2


def _of_a_loop(
    time_s: Array, tip_um: Array, command_V: Array, aim_um: Array, guard: dict[str, Any]
) -> list[str] | None:
    """Return what the set-points say against the run; None where they say nothing, and none was held to the end."""
    moves = np.flatnonzero(np.diff(aim_um) != 0.0)
    if len(moves) and (missed := _missed(time_s, tip_um, aim_um)):
        return missed
    held = slice(int(moves[-1]) + 1 if len(moves) else 0, None)
    time_s, tip_um, command_V, aim_um = time_s[held], tip_um[held], command_V[held], aim_um[held]
    if len(time_s) < _FEWEST_TICKS:
        return None
    last = slice(-max(3, round(_TAIL * len(time_s))), None)
    error_um = float(np.sqrt(np.mean((aim_um[last] - tip_um[last]) ** 2)))
    height_um = abs(float(aim_um[-1] - tip_um[0]))
    if error_um > REACHED_SHARE * height_um + NOISE_UM:
        at_V = float(np.mean(command_V[last]))
        return [f"the set-point was not reached ({error_um:.2f} µm beside it at the end, at {at_V:.1f} V)"]
    return _drift(time_s, command_V, float(guard.get("maximum_V", 0.0)) - float(guard.get("minimum_V", 0.0)))


def _missed(time_s: Array, tip_um: Array, aim_um: Array) -> list[str]:
    """Return whether a loop has missed set-points that moved; a loop is late by the best delay."""
    motion_um = float(np.std(aim_um))
    errors_um = [float(np.sqrt(np.mean((tip_um[k:] - aim_um[: len(aim_um) - k]) ** 2))) for k in _delays(time_s)]
    if min(errors_um) <= MISSED_SHARE * motion_um + NOISE_UM:
        return []
    return [f"the set-points were missed by {min(errors_um):.2f} µm rms, and their own scatter is {motion_um:.2f} µm"]


def _drift(time_s: Array, command_V: Array, range_V: float) -> list[str]:
    """Return whether the command of a loop that has settled runs away without slowing down."""
    settled = slice(len(time_s) // 3, None)
    halves = np.array_split(np.arange(len(time_s))[settled], 2)
    first_V, second_V = (_run(time_s[half], command_V[half]) for half in halves)
    if abs(first_V + second_V) <= _DRIFT_SHARE * range_V or second_V * first_V <= 0.0:
        return []
    if abs(second_V) < _STEADY * abs(first_V):
        return []
    rate = (first_V + second_V) / float(time_s[settled][-1] - time_s[settled][0])
    return [f"the command drifts by {rate:+.2f} V/s at a constant set-point: the tip creeps, or what looks at it moves"]


def _run(time_s: Array, values: Array) -> float:
    """Return how far a straight line through the values runs."""
    slope, _ = np.polyfit(time_s - time_s[0], values, 1)
    return float(slope * (time_s[-1] - time_s[0]))
