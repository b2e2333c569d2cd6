"""The model-following controller as an FMI slave: one communication step is one sample of the controller.

The builder copies this file under a content-hashed name, renames the packages that it imports likewise and fills in
the settings. The models that are inverted and that predict are chains of blocks of `bender_plant`, stepped in here;
what they read goes through metres, as it does through the FMU of the same model, so that both give the same bits.

Settings, as JSON:

| key | holds |
|---|---|
| `model` | the model as its file has it |
| `both` | parameters of both models, by FMI name, where they are not the model's own |
| `left_out` | parameters of the inverted model alone |
| `output` | what the sensor reads: `displacement` or `tip_displacement` |
| `lead_s` | dead time left in the inverted model |
| `start` | start values of the parameters of `TABLE` |
"""

import json
import math
from collections.abc import Mapping
from functools import cache
from typing import Any

from bender_export.slaves.controller import TABLE as PID_TABLE
from bender_export.slaves.shell import Row, Shell
from bender_loop.control.model_following import Memory, ModelFollower, rest, step
from bender_loop.control.pid import Gains, Limits, PidState
from bender_loop.control.shaper import Shaped, Shaper
from bender_plant.model import model_from_table
from bender_plant.plant import Plant, State

IDENTITY = "ModelFollowingController"
SETTINGS_JSON = ""

# limits bound the state of the models as well as the command: they hold for a whole run
_FIXED = ("limits.lower", "limits.upper")
TABLE = (
    *(row._replace(variability="fixed") if row.name in _FIXED else row for row in PID_TABLE),
    Row("limits.slew_rate", "parameter", "tunable", "V/s", 0.0, 0.0, 1e12, "bound of the command's rate, 0 for none"),
    Row(
        "shaper.rate", "parameter", "tunable", "um/s", 0.0, 0.0, 1e12,
        "largest velocity of the shaped setpoint, 0 for none",
    ),
    Row(
        "shaper.curvature", "parameter", "tunable", "um/s2", 0.0, 0.0, 1e15,
        "largest change of that velocity per time, 0 for none",
    ),
    Row(
        "inverse.horizon", "parameter", "tunable", "1", 1.0, 1.0, 100.0,
        "samples of held command after which the model meets the setpoint, a whole number",
    ),
    Row(
        "inverse.held_back", "parameter", "tunable", "1", 0.0, 0.0, 0.99,
        "part of a movement that is left to the PID block, which answers for a device that answers more than its model",
    ),
    Row(
        "inverse.margin", "parameter", "tunable", "um", 0.0, 0.0, 1e12,
        "distance kept from the edge of a play while the setpoint rests",
    ),
    Row("inverse.tolerance", "parameter", "tunable", "um", 1e-3, 1e-9, 1e3, "how near the inverse comes to it"),
    Row("sampling.period", "parameter", "tunable", "s", 0.01, 1e-9, 1e9, "time between samples that is planned for"),
    Row(
        "sampling.latency", "parameter", "fixed", "1", 0.0, 0.0, 1000.0,
        "samples by which a measurement is older than the step that gets it, a whole number",
    ),
    Row(
        "sampling.command_delay", "parameter", "tunable", "s", 0.0, 0.0, 1e9,
        "from the instant of a measurement until the command acts, less than a period",
    ),
)  # fmt: skip
_COMMAND, _FIRST_GAIN, _FIRST_LIMIT, _SLEW = 2, 3, 8, 11
_UM_PER_M = 1e6
_OUTPUTS = ("displacement", "tip_displacement")

PlantState = tuple[State, float, float]


def table_of(settings: Mapping[str, Any]) -> tuple[Row, ...]:
    """Return the variables of a controller with its own start values."""
    start = settings["start"]
    return tuple(row._replace(start=start.get(row.name, row.start)) for row in TABLE)


class FollowedPlant:
    """The plant of a model as the controller runs it: volts in, what the sensor or the tip shows in um out.

    Args:
        plant: its kernel, which holds no state.
        output: `displacement` or `tip_displacement`.
    """

    def __init__(self, plant: Plant, output: str) -> None:
        self._plant, self._place = plant, _OUTPUTS.index(output)
        self.reset()

    def reset(self) -> None:
        """Back to rest at t = 0."""
        self._state, self._time_s = self._plant.initial(), 0.0
        self._shown_um = _through_metres(self._plant.at_rest(0.0)[self._place])

    def read(self) -> float:
        """What it shows now, in um."""
        return self._shown_um

    def step(self, voltage_V: float, step_s: float) -> float:
        """Advance by `step_s` under the held voltage; returns what it shows then, in um."""
        self._state, *shown = self._plant.step(self._state, voltage_V, self._time_s, step_s)
        self._time_s += step_s
        self._shown_um = _through_metres(shown[self._place])
        return self._shown_um

    def save(self) -> PlantState:
        """Return all that it remembers."""
        return self._state, self._time_s, self._shown_um

    def restore(self, state: object) -> None:
        """Go back to what `save` returned."""
        self._state, self._time_s, self._shown_um = state  # pyright: ignore[reportGeneralTypeIssues]

    def close(self) -> None:
        """Nothing is held."""


def _through_metres(shown_um: float) -> float:
    return shown_um / _UM_PER_M * _UM_PER_M


@cache
def _as_built() -> tuple[Mapping[str, Any], tuple[Row, ...], Plant, Plant | None]:
    """The settings, the table, the kernel of the whole model, and that of the inverted one where it is another."""
    settings = json.loads(SETTINGS_JSON)
    whole = model_from_table(settings["model"]).with_values(settings["both"])
    inverted = Plant(whole.with_values(settings["left_out"])) if settings["left_out"] else None
    return settings, table_of(settings), Plant(whole), inverted


class ModelFollowingController(Shell):
    """Shaper, inverse of the model, prediction and PID block over FMI: metres in, volts out."""

    IDENTITY = IDENTITY

    def __init__(self, **kwargs: Any) -> None:
        settings, table, whole, inverted = _as_built()
        super().__init__(table, **kwargs)
        self.lead_s: float = settings["lead_s"]
        # each instance has plants of its own: hosts may step several at the same time
        self.predictor = FollowedPlant(whole, settings["output"])
        self.inverted = self.predictor if inverted is None else FollowedPlant(inverted, settings["output"])
        self.follower: ModelFollower | None = None
        self.rest()

    def rest(self) -> None:
        """Forget the past; model at rest, before the first sample the command is the one nearest to 0 V."""
        self.memory = rest(self.checked_follower())
        self.values[_COMMAND] = self.memory.command_V

    def recalled(self, memory: Any) -> Memory:
        """Return the memory of the controller from its plain tuples."""
        ahead, behind, frames, shaped, standing_V, feedforward_V, slope, block, command_V, begun, *rest_of = memory
        states = _plant_state(ahead), _plant_state(behind)
        voltages_V, block = (standing_V, feedforward_V), PidState(*block)
        return Memory(*states, frames, Shaped(*shaped), *voltages_V, slope, block, command_V, begun, *rest_of)

    def parameters_changed(self) -> None:
        """Take the parameters anew at the next sample."""
        self.follower = None

    def checked_follower(self) -> ModelFollower:
        """Return the controller of the present parameter values.

        Raises:
            ValueError: values that are right one by one cannot stand together, or one is no whole number.
        """
        if self.follower is None:
            values = self.values
            slew, rate, curvature, horizon, held_back, margin_um, tolerance_um, period_s, latency, delay_s = values[
                _SLEW:
            ]
            self.follower = ModelFollower(
                inverted=self.inverted,
                predictor=self.predictor,
                gains=Gains(*values[_FIRST_GAIN:_FIRST_LIMIT]),
                limits=Limits(*values[_FIRST_LIMIT:_SLEW]),
                period_s=period_s,
                slew_V_per_s=slew if slew > 0.0 else math.inf,
                shaper=Shaper(rate if rate > 0.0 else math.inf, curvature if curvature > 0.0 else math.inf),
                horizon_ticks=_whole("inverse.horizon", horizon),
                lead_s=self.lead_s,
                latency_frames=_whole("sampling.latency", latency),
                command_delay_s=delay_s,
                tolerance_um=tolerance_um,
                held_back=held_back,
                margin_um=margin_um,
            )
        return self.follower

    def step(self, current_time: float, step_size: float) -> None:
        """Take one sample of the controller."""
        del current_time
        if not 0.0 < step_size < math.inf:
            raise ValueError(f"found a step of {step_size!r} s, expected more than 0")
        values = self.values
        follower = self.follower or self.checked_follower()
        memory = step(follower, self.memory, _UM_PER_M * values[0], _UM_PER_M * values[1], step_size)
        block = memory.block
        if not (math.isfinite(memory.command_V) and math.isfinite(block.integral_V + block.derivative_V)):
            raise ArithmeticError(
                f"found a command of {memory.command_V!r} V from setpoint {values[0]!r} m and measurement "
                f"{values[1]!r} m, expected a finite one"
            )
        self.memory, values[_COMMAND] = memory, memory.command_V


def _plant_state(plain: Any) -> PlantState:
    state, time_s, shown_um = plain
    return State(*state), time_s, shown_um


def _whole(name: str, value: float) -> int:
    if value != int(value):
        raise ValueError(f"{name}: found {value!r}, expected a whole number")
    return int(value)
