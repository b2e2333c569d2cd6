"""Objectives: gains to one number that a search makes small, with what stands behind it.

The paper's, equation (28), is the mean squared error. It is kept to compare with; on the sampled loop it buys its
last per cent with sensitivity peaks of 20. `bender_tuner.task.practitioner` holds the one to tune with.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from numpy.typing import ArrayLike

from bender_loop.control.metrics import StepMetrics
from bender_loop.control.pid import Gains
from bender_tuner.task.experiment import StepExperiment
from bender_tuner.task.search_space import GainSpace


class Objective(Protocol):
    """What a search minimises."""

    def __call__(self, gains: Gains) -> float:
        """The value; inf for gains under which the loop runs away."""
        ...


@dataclass(frozen=True, slots=True)
class FigureObjective:
    """One figure of a step response.

    Attributes:
        name: of the figure.
        unit: of the figure.
        experiment: what is run.
        figure: picks the value from the figures of the response.
    """

    name: str
    unit: str
    experiment: StepExperiment
    figure: Callable[[StepMetrics], float]

    def __call__(self, gains: Gains) -> float:
        """The figure; inf where the run diverged."""
        return self.evaluate(gains)[0]

    def evaluate(self, gains: Gains) -> tuple[float, StepMetrics]:
        """(value, all figures of the response)."""
        metrics = self.experiment.metrics(self.experiment.run(gains))
        value = self.figure(metrics)
        return (math.inf if math.isnan(value) else value), metrics


def mean_squared_error(experiment: StepExperiment) -> FigureObjective:
    """Paper equation (28) with its n + 1 samples in the denominator, um^2."""
    return FigureObjective("MSE", "um^2", experiment, lambda metrics: metrics.mse_um2)


def itae(experiment: StepExperiment) -> FigureObjective:
    """Integral of time times absolute error, um s^2."""
    return FigureObjective("ITAE", "um s^2", experiment, lambda metrics: metrics.itae_um_s2)


def at_point(objective: Objective, space: GainSpace, x: ArrayLike) -> float:
    """The objective at a point of a search space; inf where the point stands for no gains."""
    try:
        gains = space.to_gains(x)
    except ValueError:
        return math.inf
    return objective(gains)
