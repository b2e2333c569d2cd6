"""A fold of the reading: the plain readings folded, by numpy."""

from typing import Any

import numpy as np

PARAMETERS: list[dict[str, Any]] = [
    {"share": 1.0, "centre_um": 8.0},
    {"share": 0.6, "centre_um": -3.0},
    {"share": 1.0, "centre_um": 8.0, "rounding_um": 5.0},
]
VOLTS_V = np.array([20.0, -20.0, -45.0, 10.0, -10.0, 30.0, 0.0, -50.0, 5.0, 5.0, -5.0, 49.0])


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    centre, b = parameters["centre_um"], parameters.get("rounding_um", 0.0)
    size = np.hypot(np.array([0.0, *plain_um]) - centre, b)
    return (1.0 - parameters["share"]) * plain_um + parameters["share"] * (size[1:] - size[0])
