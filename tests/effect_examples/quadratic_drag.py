"""Drag with the square of the speed, integrated."""

import math
from typing import Any

import numpy as np
from chain_oracle import OMEGA, with_force

PARAMETERS: list[dict[str, Any]] = [{"drag_1_per_um": 0.02}, {"drag_1_per_um": 0.3}]


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    d = parameters["drag_1_per_um"]
    return with_force(voltages_V, step_s, lambda q, v, x: d * math.copysign(v * v, v) / OMEGA**2)
