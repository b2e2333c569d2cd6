"""A spring with a square in its force, integrated."""

from typing import Any

import numpy as np
from chain_oracle import with_force

PARAMETERS: list[dict[str, Any]] = [{"quadratic_1_per_um": 0.01}, {"quadratic_1_per_um": -0.004}]


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    return with_force(voltages_V, step_s, lambda q, v, x: parameters["quadratic_1_per_um"] * q * q)
