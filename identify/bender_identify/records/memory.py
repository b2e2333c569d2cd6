"""How long a linear model answers a command: what was commanded earlier does not matter any more."""

import math

from bender_plant.blocks import bending_modes, second_mode
from bender_plant.model import Model

FORGOTTEN = math.log(100.0)
"""Time constants until a hundredth is left of an answer."""
LAGS = ("plant_lag", "sensor_lag", "source_resistance")


def memory_s(model: Model) -> float:
    """Return until when a hundredth of the answer to a command is left, by the lags, modes and delay of a model."""
    values = model.values()
    # two alike, one behind the other, forget later than each
    lags_s = sum(x for name, x in values.items() if name.split(".")[0] in LAGS and name.endswith("time_constant"))
    decays_s = [lags_s]
    for block in model.blocks:
        if isinstance(block.parameters, bending_modes.Parameters):
            modes = bending_modes.constants(block.parameters, model.beam)
            decays_s += [1.0 / (omega * zeta) for omega, zeta, *_ in modes]
        if isinstance(block.parameters, second_mode.Parameters):
            x = block.parameters
            decays_s.append(1.0 / (2.0 * math.pi * x.frequency_Hz * x.damping_ratio))
    return values.get("transport_delay.delay", 0.0) + FORGOTTEN * max(decays_s)
