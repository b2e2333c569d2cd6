"""A static curve, by numpy's polynomials."""

from typing import Any

import numpy as np

PARAMETERS: list[dict[str, Any]] = [
    {"quadratic_1_per_um": 0.01, "cubic_1_per_um2": 1e-4},
    {"quartic_1_per_um3": 1e-5, "quintic_1_per_um4": -1e-7},
]
NAMES = ("quadratic_1_per_um", "cubic_1_per_um2", "quartic_1_per_um3", "quintic_1_per_um4")


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    return np.polynomial.Polynomial([0.0, 1.0, *(parameters.get(name, 0.0) for name in NAMES)])(plain_um)
