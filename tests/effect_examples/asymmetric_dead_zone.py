"""A dead zone that is wider on one side: commands with what lies between the thresholds taken out."""

from typing import Any

import numpy as np
from chain_oracle import with_force

PARAMETERS: list[dict[str, Any]] = [{"positive_V": 2.0, "negative_V": 8.0}, {"positive_V": 5.0}]
VOLTS_V = np.array([20.0, -20.0, -45.0, 10.0, -10.0, 30.0, 0.0, -50.0, 5.0, 5.0, -5.0, 49.0])


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    low, high = -parameters.get("negative_V", 0.0), parameters["positive_V"]
    return with_force(voltages_V - np.clip(voltages_V, low, high), step_s, lambda q, v, x: 0.0)
