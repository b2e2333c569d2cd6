"""The plant as an FMI slave: the chain of blocks of `bender_plant`, stepped by the host.

The builder copies this file under a content-hashed name, renames the packages that it imports likewise and fills in
the model. Everything the plant needs is imported here: a host may delete the unpacked FMU while it still runs.
"""

import json
import math
from collections.abc import Callable
from functools import cache
from typing import Any

from bender_export.slaves.shell import Row, Shell
from bender_plant.model import Model, model_from_table
from bender_plant.plant import Plant, State
from bender_plant.variables import variables

IDENTITY = "PiezoBender"
MODEL_JSON = ""

_UM_PER_M = 1e6
# at rest every block stands still, so that a step of no length worth the name reads what the sensor shows
_INSTANT_S = 1e-9


def table_of(model: Model) -> tuple[Row, ...]:
    """Return the variables of the plant FMU of a model."""
    return tuple(
        Row(
            variable.name,
            variable.causality,
            variable.variability,
            variable.unit,
            0.0 if variable.start is None else variable.start,
            -math.inf if variable.minimum is None else variable.minimum,
            math.inf if variable.maximum is None else variable.maximum,
            variable.description,
        )
        for variable in variables(model)
    )


@cache
def _as_built() -> tuple[Model, Plant, tuple[Row, ...]]:
    model = model_from_table(json.loads(MODEL_JSON))
    return model, Plant(model), table_of(model)


class PiezoBender(Shell):
    """The piezo bending actuator over FMI: volts in, metres out."""

    IDENTITY = IDENTITY

    def __init__(self, **kwargs: Any) -> None:
        _, plant, table = _as_built()
        super().__init__(table, **kwargs)
        self.advance: Callable[..., Any] = plant.step
        self.initial = plant.initial()
        self.stale = False
        self.rest()

    def rest(self) -> None:
        """Start at rest; the outputs are what the sensor and the tip show at the start time."""
        if self.stale:
            self.rebuild()
        self.memory = self.initial
        _, displacement_um, tip_um = self.advance(self.initial, 0.0, self.start_time_s, _INSTANT_S)
        self.show(displacement_um, tip_um)

    def recalled(self, memory: Any) -> State:
        """Return the state of the plant from its plain tuples."""
        return State(*memory)

    def parameters_changed(self) -> None:
        """Let the next step make the plant anew from the values that then stand."""
        self.stale = True

    def rebuild(self) -> None:
        """Make the plant of the present parameter values; the state stays as it is.

        Raises:
            ModelError: values that are right one by one cannot stand together.
        """
        model, plant, table = _as_built()
        changed = {
            row.name: value
            for row, value in zip(table, self.values, strict=True)
            if row.causality == "parameter" and value != row.start
        }
        if changed:
            plant = Plant(model.with_values(changed))
        self.advance = plant.step
        self.initial = plant.initial()
        self.stale = False

    def step(self, current_time: float, step_size: float) -> None:
        """Hold the voltage for one communication step; time is absolute, so that disturbances keep their phase."""
        if self.stale:
            self.rebuild()
        memory, displacement_um, tip_um = self.advance(self.memory, self.values[0], current_time, step_size)
        self.show(displacement_um, tip_um)
        self.memory = memory

    def show(self, displacement_um: float, tip_um: float) -> None:
        """Set the outputs."""
        self.values[1] = displacement_um / _UM_PER_M
        self.values[2] = tip_um / _UM_PER_M
