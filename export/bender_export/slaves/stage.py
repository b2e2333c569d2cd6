"""Stages of the chain by themselves, around a plant that is not ours: FMI slaves over the same kernels.

What acts before hands on the mean of its signal over the step, so that a plant that holds its input gets the right
amount of it; what acts behind takes what the plant shows at the end of the step and runs straight there. What acts
inside the plant stands beside it: a model of the plant with it is added to what the plant shows, one without is taken
from that.
"""

import math

from bender_export.slaves.plant import PiezoBender, table_of
from bender_export.slaves.shell import Row
from bender_plant.model import Model
from bender_plant.variables import SIGNALS

# at rest every block stands still, so that a step of no length worth the name reads what it shows
_INSTANT_S = 1e-9
_U, _Y, _SCALE, _REST = range(4)
_COMMAND, _PASSED, _SUM, _COMMAND_SCALE, _SUM_SCALE, _SIGN = range(6)


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


class StageBeside(PiezoBender):
    """A model of the plant that gets the same command; what it shows is added to what the plant shows, or taken off."""

    def rest(self) -> None:
        """Start at rest."""
        self.memory = self.initial
        _, reading, _ = self.advance(self.initial, 0.0, self.start_time_s, _INSTANT_S)
        self.values[_SUM] = self.values[_PASSED] + self.values[_SIGN] * reading / self.values[_SUM_SCALE]

    def step(self, current_time: float, step_size: float) -> None:
        """Hold the command for one communication step; add what the model shows at its end."""
        volts = self.values[_COMMAND] * self.values[_COMMAND_SCALE]
        memory, reading, _ = self.advance(self.memory, volts, current_time, step_size)
        self.values[_SUM] = self.values[_PASSED] + self.values[_SIGN] * reading / self.values[_SUM_SCALE]
        self.memory = memory


def beside_table(model: Model, sign: float, scales: tuple[float, float], rest: float) -> tuple[Row, ...]:
    """Return the variables of a model beside a plant.

    Args:
        model: of the plant, from V to um.
        sign: 1 adds what it shows to what the plant shows, -1 takes it off.
        scales: V per unit of the command, um per unit of what the plant shows.
        rest: of what the plant shows, in its own unit.
    """
    least = math.ulp(0.0)
    own = (
        Row("taken", "input", "continuous", "1", 0.0, -math.inf, math.inf, "command, held over a communication step"),
        Row("passed", "input", "continuous", "1", rest, -math.inf, math.inf, "what the plant shows"),
        Row("shown", "output", "continuous", "1", 0.0, -math.inf, math.inf, "the same with that of the model"),
        Row("scale", "parameter", "fixed", "1", scales[0], least, math.inf, "V per unit of the command"),
        Row("shown_scale", "parameter", "fixed", "1", scales[1], least, math.inf, "um per unit of what is shown"),
        Row("sign", "parameter", "fixed", "1", sign, -1.0, 1.0, "1 adds what the model shows, -1 takes it off"),
    )
    return (*own, *table_of(model)[len(SIGNALS) :])


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
