"""A tuned loop on devices that are not what was diagnosed: another gain, another resonance, a later frame."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bender_loop.records.record import Record
from bender_proving import Case, Hidden
from bender_studies.control.hidden_loop import Controller

GAIN, RESONANCE = (0.7, 1.3), (0.8, 1.4)
"""Factors of the device's own, both ends included in what is drawn."""
LATER_FRAMES = 1
_END_S = 1.0
_STILL_UM, _DYING = 1.0, 0.8


@dataclass(frozen=True, slots=True)
class Late:
    """A controller that sees each reading so many frames later; before the first one it sees rest."""

    controller: Controller
    frames: int = LATER_FRAMES

    def rest(self) -> Any:
        """Return the state before the first sample."""
        return self.controller.rest(), (0.0,) * self.frames

    def step(self, state: Any, time_s: float, reading_um: float) -> tuple[Any, float]:
        """Return the state after a sample, and the command in V."""
        inner, waiting = state
        waiting = (*waiting, reading_um)
        inner, command_V = self.controller.step(inner, time_s, waiting[0])
        return (inner, waiting[1:]), command_V


def off_nominal(case: Case, count: int) -> Iterator[Case]:
    """The device with gains and resonances drawn evenly from the ranges; where tip mass is hidden it keeps its own."""
    rng = np.random.default_rng([case.entropy, count])
    for _ in range(count):
        gain, ratio = float(rng.uniform(*GAIN)), float(rng.uniform(*RESONANCE))
        moved = case.effects
        if "tip_mass" not in case.effect_ids:
            numbers = (("frequency_ratio", ratio), ("static_gain", 1.0))
            moved = (*moved, Hidden("tip_mass", "added_mass", ratio - 1.0, numbers))
        yield replace(case, gain=gain * case.gain, effects=moved)


def is_unstable(record: Record, reach_um: tuple[float, float] = (-math.inf, math.inf)) -> bool:
    """Whether a run ends in a swing, or away from its set-point, of more than 1 um, and comes to rest no more.

    It does where it loses a fifth of either from one second to the next. Away counts where the set-point is in reach.

    Args:
        record: with set-points, or without: then only the swing counts.
        reach_um: lowest and highest set-point that the device can be led to.
    """
    end_s = float(record.time_s[-1])
    before = (record.time_s > end_s - 2.0 * _END_S) & (record.time_s <= end_s - _END_S)
    last = record.time_s > end_s - _END_S
    tip_um = record.displacement_um
    if _stays(float(np.ptp(tip_um[before])), float(np.ptp(tip_um[last]))):
        return True
    if record.setpoint_um is None or not reach_um[0] <= record.setpoint_um[-1] <= reach_um[1]:
        return False
    away_um = np.abs(tip_um - record.setpoint_um)
    return _stays(float(np.mean(away_um[before])), float(np.mean(away_um[last])))


def _stays(before_um: float, last_um: float) -> bool:
    return last_um > max(_STILL_UM, _DYING * before_um)
