"""The two models of a model-following controller, both from one FMU that can save its state.

One is inverted and one predicts. Dead time and the lag and steps of a sensor cannot be inverted, or should not be: the
plant FMUs of this project have a parameter for each, which is neutral in the inverted one. An FMU without them is
inverted as it is, over a horizon that reaches beyond the dead time of its own answer. What belongs to a record and
does not come again (drift, hum, ageing) is neutral in both.
"""

import contextlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bender_loop.control.plant import restart
from bender_loop.errors import InputError, RunError
from bender_loop.fmu.file import read_description
from bender_loop.fmu.plant import FmuPlant
from bender_loop.tables.quantities import USUAL, Quantities

DELAY = "transport_delay.delay"
LEFT_OUT = (DELAY, "sensor_lag.time_constant", "sensor_quantisation.step", "supply_quantisation.step")
"""Parameters of our plant FMUs that are 0 in the model that is inverted."""
NOT_AGAIN = ("thermal_drift.amplitude", "periodic_disturbance.sine", "periodic_disturbance.cosine", "ageing.loss")
"""Parameters that are 0 in both."""
_LONGEST_DEAD_TIME_S, _LOOK_S = 10.0, 1e-3
_ANSWERS = 1e-3
_DOUBLINGS = 5


@dataclass(frozen=True, slots=True, eq=False)
class FollowingModels:
    """Both models, open.

    Attributes:
        path: of the FMU.
        inverted: what is inverted.
        predictor: what predicts; the same object where nothing is left out of the other.
        dead_time_s: of the predictor, by which a known reference is looked at beforehand.
        lead_s: dead time that is still in `inverted`.
        left_out: parameters of `inverted` by FMI name, with the values that stand in for the model's.
        parameters: of both, by FMI name, where they are not the FMU's own.
        quantities: of what is commanded and read.
    """

    path: Path
    inverted: FmuPlant
    predictor: FmuPlant
    dead_time_s: float
    lead_s: float
    left_out: dict[str, float] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    quantities: Quantities = USUAL


@contextlib.contextmanager
def open_following_models(
    path: Path,
    *,
    input_name: str | None = None,
    output_name: str | None = None,
    parameters: Mapping[str, float] | None = None,
    quantities: Quantities = USUAL,
) -> Iterator[FollowingModels]:
    """Open both models of the FMU at `path`; they are closed when the context ends.

    Args:
        path: the FMU.
        input_name: as in `FmuPlant`.
        output_name: as in `FmuPlant`.
        parameters: values by FMI name, where they are not the FMU's own.
        quantities: as in `FmuPlant`.

    Raises:
        InputError: bad FMU, variable or parameter, or one that cannot save its state.
        RunError: the FMU fails.
    """
    starts = {x.name: x.start for x in read_description(path).modelVariables if x.causality == "parameter"}
    both, left_out = neutral(starts, parameters or {})
    with contextlib.ExitStack() as ends:

        def opened(values: Mapping[str, float]) -> FmuPlant:
            plant = FmuPlant(
                path, input_name=input_name, output_name=output_name, parameters=values, quantities=quantities
            )
            ends.callback(plant.close)
            if not plant.can_save:
                raise InputError(
                    f"{path}: the FMU cannot save its state (canGetAndSetFMUstate), which inverting it needs; tune "
                    "without --follow-model, or export the FMU with that capability"
                )
            return plant

        predictor = opened(both)
        inverted = opened(both | left_out) if left_out else predictor
        dead_time_s, lead_s = float(both.get(DELAY, starts.get(DELAY) or 0.0)), 0.0
        if DELAY not in starts:
            dead_time_s = lead_s = dead_time_of(inverted, 1.0)
        yield FollowingModels(path, inverted, predictor, dead_time_s, lead_s, left_out, both, quantities)


def neutral(starts: Mapping[str, Any], parameters: Mapping[str, float]) -> tuple[dict[str, float], dict[str, float]]:
    """Return the parameters of both models, and those that are neutral in the inverted one alone, by FMI name.

    Args:
        starts: start values of all parameters of the model.
        parameters: values where they are not the start values.
    """
    both = dict(parameters) | {name: 0.0 for name in NOT_AGAIN if name in starts}
    left_out = {name: 0.0 for name in LEFT_OUT if name in starts and float(both.get(name, starts[name] or 0.0)) != 0.0}
    return both, left_out


def dead_time_of(plant: FmuPlant, step_V: float) -> float:
    """Return how long a plant at rest takes to answer a step at all; 0 for one that answers at once.

    A play or a dead zone is crossed sooner by a larger step, a dead time is not: it is the shortest over steps from
    `step_V` on, each twice as large as the one before, as far as the plant takes them.
    """
    shortest_s = math.inf
    for doublings in range(_DOUBLINGS + 1):
        try:
            shortest_s = min(shortest_s, _answered_after(plant, step_V * 2.0**doublings, _LOOK_S))
        except RunError:
            if doublings == 0:
                raise
            break
        if shortest_s == 0.0:
            break
    return shortest_s if math.isfinite(shortest_s) else 0.0


def _answered_after(plant: FmuPlant, step_V: float, look_s: float) -> float:
    """When the answer exceeds a thousandth of what it has come to twice that time later; inf if it never does."""
    first = restart(plant)
    readings = np.zeros(math.ceil(_LONGEST_DEAD_TIME_S / look_s))
    for k in range(readings.size):
        readings[k] = last = abs(plant.step(step_V, look_s) - first)
        if last == 0.0:
            continue
        began = int(np.argmax(readings[: k + 1] > _ANSWERS * last))
        if k >= 2 * began + 5:
            return began * look_s
    return math.inf
