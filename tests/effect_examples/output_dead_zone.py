"""A dead zone of the output: the readings with what lies inside the gap taken out, by numpy."""

from typing import Any

import numpy as np

PARAMETERS: list[dict[str, Any]] = [
    {"width_um": 4.0},
    {"width_um": 2.0, "centre_um": 5.0},
    {"width_um": 6.0, "centre_um": -2.0, "rounding_um": 1.5},
]


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    centre, half = parameters.get("centre_um", 0.0), parameters["width_um"] / 2
    s = parameters.get("rounding_um", 0.0)
    way = np.array([0.0, *plain_um]) - centre
    if s == 0.0:
        passed = way - np.clip(way, -half, half)
    else:
        passed = s * (np.logaddexp(0.0, (way - half) / s) - np.logaddexp(0.0, (-way - half) / s))
    return passed[1:] - passed[0]
