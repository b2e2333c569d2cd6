"""What a change does to the loop of the present gains: peak sensitivity and a step, of the model before and after."""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from bender_loop.control.closed_loop import simulate
from bender_loop.control.metrics import step_metrics
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Step
from bender_loop.control.sampling import Sampling
from bender_plant.model import Model
from bender_plant.plant import Plant, State
from bender_tuner.model.loop_transfer import DelayedPlant
from bender_tuner.model.margins import margins
from bender_tuner.model.sampled_model import model_from_step

SMALL_STEP = 0.02
"""Of the range of the command: a step that is small enough for a linear model, about the middle of the range."""
PERIODS = 300
WORTH = 0.2
"""Of Ms or of the settling time: a change that calls for other gains."""
TOO_CLOSE = 2.0
"""Ms beyond which a loop is near its limit (Astrom and Murray, Feedback Systems, section 12.2)."""


@dataclass(frozen=True, slots=True)
class LoopFigures:
    """A loop.

    Attributes:
        sensitivity_peak: Ms; inf where the loop is unstable.
        settling_s: of a step by half the range, to 2 %; nan for never.
        overshoot_percent: of it.
    """

    sensitivity_peak: float
    settling_s: float
    overshoot_percent: float

    def to_dict(self) -> dict[str, Any]:
        """Return the figures; what is not finite is None."""
        return {name: x if math.isfinite(x) else None for name, x in asdict(self).items()}


@dataclass(slots=True)
class _ModelPlant:
    """A model behind the `Plant` protocol."""

    plant: Plant
    _state: State | None = None
    _time_s: float = 0.0

    def reset(self) -> None:
        self._state, self._time_s = self.plant.initial(), 0.0

    def read(self) -> float:
        return self.plant.at_rest(0.0)[0]

    def step(self, voltage_V: float, step_s: float) -> float:
        assert self._state is not None
        self._state, reading, _ = self.plant.step(self._state, voltage_V, self._time_s, step_s)
        self._time_s += step_s
        return reading

    def close(self) -> None:
        self._state = None


def loop_figures(model: Model, gains: Gains, limits: Limits, period_s: float) -> LoopFigures:
    """Return the figures of a loop around a model."""
    plant = _ModelPlant(Plant(model))
    low, high = limits.lower_V, limits.upper_V
    middle, small = 0.5 * (low + high), SMALL_STEP * (high - low)
    plant.reset()
    before = [plant.step(middle, period_s) for _ in range(PERIODS)][-1]
    answer = [before, *(plant.step(middle + small, period_s) for _ in range(PERIODS))]
    sampled = model_from_step(period_s, (np.array(answer) - before) / small)
    peak = margins(gains, DelayedPlant(sampled)).sensitivity_peak
    plant.reset()
    setpoint_um = [plant.step(middle, period_s) for _ in range(PERIODS)][-1]
    duration_s = PERIODS * period_s
    trace = simulate(plant, gains, limits, Step(setpoint_um), Sampling(period_s), duration_s)
    found = step_metrics(trace, setpoint_um)
    return LoopFigures(peak, found.settling_time_s, found.overshoot_percent)


def worth_tuning(before: LoopFigures, after: LoopFigures) -> bool:
    """Return whether the loop has become so different that other gains pay."""
    if not math.isfinite(after.sensitivity_peak) or not math.isfinite(after.settling_s):
        return True
    closer = after.sensitivity_peak > max(TOO_CLOSE, (1.0 + WORTH) * before.sensitivity_peak)
    return closer or after.settling_s > (1.0 + WORTH) * before.settling_s
