"""A tuned loop on devices that are not what was diagnosed: another gain, another resonance, a later frame."""

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


def is_unstable(record: Record) -> bool:
    """Whether a run ends in a swing of more than 1 um that does not lose a fifth from one second to the next."""
    end_s = float(record.time_s[-1])
    before = record.displacement_um[(record.time_s > end_s - 2.0 * _END_S) & (record.time_s <= end_s - _END_S)]
    last = record.displacement_um[record.time_s > end_s - _END_S]
    return float(np.ptp(last)) > max(_STILL_UM, _DYING * float(np.ptp(before)))
