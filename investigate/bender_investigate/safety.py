"""What a bench allows, and whether a profile stays within it by every model at hand.

A profile is simulated before it is played. The guard holds the limits in any case; a profile that would meet them is
not played at all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bender_compiled.simulation import Drive, Simulator
from bender_hil.runner.voltages import Voltages
from bender_plant.model import Model
from bender_plant.parameter import ModelError

Array = NDArray[np.float64]

SLEW_SHARE = 0.9
"""A profile keeps to this share of the guard's slew limit, so that the guard never has to."""
TRAVEL_SHARE = 0.9
"""And the tip, by simulation, to this share of the travel."""
_SLACK_V = 1e-9


@dataclass(frozen=True, slots=True)
class Allowed:
    """Limits of a bench.

    Attributes:
        low_V, high_V: of the command.
        slew_V_per_s: fastest change of the command.
        burst_s: a single change is at most the slew times this.
        travel_um: the tip stays between these.
        rate_Hz: frames, and so rows, per second.
    """

    low_V: float
    high_V: float
    slew_V_per_s: float
    burst_s: float
    travel_um: tuple[float, float]
    rate_Hz: float

    @property
    def step_s(self) -> float:
        """Time between rows."""
        return 1.0 / self.rate_Hz

    @property
    def change_V(self) -> float:
        """Largest change of a profile from row to row."""
        return SLEW_SHARE * self.slew_V_per_s * min(self.step_s, self.burst_s)

    @property
    def profile_slew_V_per_s(self) -> float:
        """Rate of change of a profile that has rows at the rate of the camera."""
        return self.change_V * self.rate_Hz


def rows_of(voltages: Voltages, rate_Hz: float) -> tuple[Array, Array]:
    """Return a profile at the rows of a camera: times in s and the commands, both (n,)."""
    count = max(2, round(voltages.duration_s * rate_Hz))
    times = np.arange(count, dtype=np.float64) / rate_Hz
    index = np.searchsorted(voltages.times_s, times + 1e-9, side="right") - 1
    return times, np.asarray(voltages.levels_V, dtype=np.float64)[np.maximum(index, 0)]


def of_rows(levels_V: Array, rate_Hz: float) -> Voltages:
    """Return a profile whose levels are held for a row each."""
    kept = np.concatenate([[True], np.diff(levels_V) != 0.0])
    rows = np.flatnonzero(kept)
    times = tuple(float(row) / rate_Hz for row in rows)
    return Voltages(times, tuple(float(x) for x in levels_V[rows]), levels_V.size / rate_Hz)


def scaled(voltages: Voltages, factor: float) -> Voltages:
    """Return the profile with every level smaller."""
    return replace(voltages, levels_V=tuple(factor * x for x in voltages.levels_V))


def reached_um(model: Model, voltages: Voltages, rate_Hz: float) -> tuple[float, float]:
    """Return the lowest and the highest reading of a model under a profile, in µm.

    Raises:
        ArithmeticError: the model runs away.
        ModelError: a number of the model is out of its bounds.
    """
    reading_um = Simulator(Drive.of_rows(*rows_of(voltages, rate_Hz)), coarser=3.0).run(model).reading_um
    return float(np.min(reading_um)), float(np.max(reading_um))


def refusal(voltages: Voltages, allowed: Allowed, models: Sequence[Model]) -> str | None:
    """Return why a profile must not be played, None where every model stays within the limits.

    Args:
        voltages: the profile.
        allowed: by the bench.
        models: every one that may be true.
    """
    levels = np.asarray(voltages.levels_V)
    low_V, high_V = float(levels.min()), float(levels.max())
    if low_V < allowed.low_V - _SLACK_V or high_V > allowed.high_V + _SLACK_V:
        return f"it commands {low_V:.4g} to {high_V:.4g} V, allowed are {allowed.low_V:g} to {allowed.high_V:g} V"
    _, rows_V = rows_of(voltages, allowed.rate_Hz)
    change_V = float(np.max(np.abs(np.diff(rows_V, prepend=0.0))))
    if change_V > allowed.change_V * (1.0 + 1e-9) + _SLACK_V:
        return f"it changes by {change_V:.4g} V from row to row, allowed are {allowed.change_V:.4g} V"
    low_um, high_um = (TRAVEL_SHARE * x for x in allowed.travel_um)
    for model in models:
        try:
            least_um, most_um = reached_um(model, voltages, allowed.rate_Hz)
        except (ArithmeticError, ModelError) as error:
            return f"the model {model.name} cannot predict where the tip goes ({error})"
        if least_um < low_um or most_um > high_um:
            return (
                f"by the model {model.name} the tip goes from {least_um:.4g} to {most_um:.4g} µm, the bench allows "
                f"{low_um:.4g} to {high_um:.4g} µm with a margin"
            )
    return None
