"""Stages of the chain by themselves, before or behind a plant that is not ours: FMI slaves over the same kernels.

What acts before hands on the mean of its signal over the step, so that a plant that holds its input gets the right
amount of it; what acts behind takes what the plant shows at the end of the step and runs straight there.
"""

import math

from bender_export.slaves.plant import PiezoBender, table_of
from bender_export.slaves.shell import Row
from bender_plant.model import Model
from bender_plant.variables import SIGNALS

# at rest every block stands still, so that a step of no length worth the name reads what it shows
_INSTANT_S = 1e-9
_U, _Y, _SCALE, _REST = range(4)


class StagesBefore(PiezoBender):
    """What acts on the input of a plant: supply and material, from its unit into its unit."""

    def rest(self) -> None:
        """Start at rest."""
        self.memory = self.initial
        _, _, _, mean = self.advance(self.initial, 0.0, self.start_time_s, _INSTANT_S)
        self.values[_Y] = self.values[_REST] + mean / self.values[_SCALE]

    def step(self, current_time: float, step_size: float) -> None:
        """Hold the input for one communication step; show the mean of what comes out over it."""
        signal = (self.values[_U] - self.values[_REST]) * self.values[_SCALE]
        memory, _, _, mean = self.advance(self.memory, signal, current_time, step_size)
        self.values[_Y] = self.values[_REST] + mean / self.values[_SCALE]
        self.memory = memory


class StagesBehind(PiezoBender):
    """What acts on the output of a plant: creep, play, surroundings and sensor, from its unit into its unit."""

    def rest(self) -> None:
        """Start at rest."""
        self.memory = self.initial
        _, reading, _ = self.advance(self.initial, 0.0, self.start_time_s, _INSTANT_S)
        self.values[_Y] = self.values[_REST] + reading / self.values[_SCALE]

    def step(self, current_time: float, step_size: float) -> None:
        """Take the input for where the plant is at the end of one communication step."""
        signal = (self.values[_U] - self.values[_REST]) * self.values[_SCALE]
        memory, reading, _ = self.advance(self.memory, signal, current_time, step_size)
        self.values[_Y] = self.values[_REST] + reading / self.values[_SCALE]
        self.memory = memory


def stage_table(kind: type[PiezoBender], model: Model, scale: float, rest: float) -> tuple[Row, ...]:
    """Return the variables of stages by themselves.

    Args:
        kind: StagesBefore or StagesBehind.
        model: of the stages alone.
        scale: V or um per unit of the signal.
        rest: of the signal where the chain has 0, in its own unit.
    """
    before = kind is StagesBefore
    taken = "command, held over a communication step" if before else "what the plant shows at the end of the step"
    shown = "mean over the step of what acts on the plant" if before else "what the sensor reads at the end of the step"
    least = math.ulp(0.0)
    own = (
        Row("taken", "input", "continuous", "1", rest, -math.inf, math.inf, f"{taken}, in its own unit"),
        Row("shown", "output", "continuous", "1", 0.0, -math.inf, math.inf, f"{shown}, in the same unit"),
        Row("scale", "parameter", "fixed", "1", scale, least, math.inf, "V or um per unit of the signal"),
        Row("rest", "parameter", "fixed", "1", rest, -math.inf, math.inf, "of the signal where the chain has 0"),
    )
    return (*own, *table_of(model)[len(SIGNALS) :])
