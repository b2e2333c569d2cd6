"""How long a linear model answers a command: what was commanded earlier does not matter any more."""

import math

from bender_plant.blocks import bending_modes
from bender_plant.model import Model

FORGOTTEN = math.log(100.0)
"""Time constants until a hundredth is left of an answer."""
LAGS = ("plant_lag", "sensor_lag", "source_resistance")


def memory_s(model: Model) -> float:
    """Return until when a hundredth of the answer to a command is left, by the modes, lags and delay of a model."""
    values = model.values()
    times_s = [
        value for name, value in values.items() if name.partition(".")[0] in LAGS and name.endswith("time_constant_s")
    ]
    for block in model.blocks:
        if isinstance(block.parameters, bending_modes.Parameters):
            times_s += [
                1.0 / (omega * zeta) for omega, zeta, *_ in bending_modes.constants(block.parameters, model.beam)
            ]
    return values.get("transport_delay.delay_s", 0.0) + FORGOTTEN * max(times_s, default=0.0)
