"""Another gain of negative commands: the commands themselves with another gain."""

from typing import Any

import numpy as np
from chain_oracle import with_force

PARAMETERS: list[dict[str, Any]] = [{"difference": 0.3}, {"difference": -0.4}]
VOLTS_V = np.array([20.0, -20.0, -45.0, 10.0, -10.0, 30.0, 0.0, -50.0, 5.0, 5.0, -5.0, 49.0])


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    scaled = np.where(voltages_V < 0.0, (1.0 + parameters["difference"]) * voltages_V, voltages_V)
    return with_force(scaled, step_s, lambda q, v, x: 0.0)
