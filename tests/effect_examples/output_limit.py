"""A limit of the output: the plain readings clipped, by numpy."""

from typing import Any

import numpy as np

PARAMETERS: list[dict[str, Any]] = [
    {"level_um": 10.0},
    {"level_um": 4.0, "remaining_slope": 0.3, "form": "below"},
    {"level_um": 8.0, "remaining_slope": 0.1, "rounding_um": 2.0},
]
VOLTS_V = np.array([20.0, -20.0, -45.0, 10.0, -10.0, 30.0, 0.0, -50.0, 5.0, 5.0, -5.0, 49.0])


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    sign = -1.0 if parameters.get("form") == "below" else 1.0
    beyond = sign * np.array([0.0, *plain_um]) - parameters["level_um"]
    b = parameters.get("rounding_um", 0.0)
    lost = b * np.logaddexp(0.0, beyond / b) if b else np.maximum(beyond, 0.0)
    passed = sign * (beyond - (1.0 - parameters.get("remaining_slope", 0.0)) * lost)
    return passed[1:] - passed[0]
