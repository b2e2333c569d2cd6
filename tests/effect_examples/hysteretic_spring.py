"""A Bouc-Wen spring beside the linear one, integrated."""

from typing import Any

import numpy as np
from chain_oracle import with_force

PARAMETERS: list[dict[str, Any]] = [
    {"share": 0.3, "beta_1_per_um": 0.2, "gamma_1_per_um": 0.1},
    {"share": 1.0, "beta_1_per_um": 0.1, "gamma_1_per_um": -0.05},
]


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    alpha, beta, gamma = (parameters[x] for x in ("share", "beta_1_per_um", "gamma_1_per_um"))
    return with_force(
        voltages_V, step_s, lambda q, v, z: z, lambda v, z: alpha * v - beta * abs(v) * z - gamma * v * abs(z)
    )
