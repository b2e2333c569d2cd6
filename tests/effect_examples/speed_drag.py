"""Drag on the lag between film and mode, as one system of differential equations."""

from typing import Any

import numpy as np
from chain_oracle import OMEGA, PRECISE, ZETA, relaxation
from scipy.integrate import solve_ivp

PARAMETERS: list[dict[str, Any]] = [
    {"time_constant_s": 0.05, "drag_1_per_um": 0.02},
    {"time_constant_s": 0.4, "drag_1_per_um": 0.1},
]


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    del plain_um
    tau, drag = parameters["time_constant_s"], parameters["drag_1_per_um"]
    x = np.zeros(4)
    found = []
    for u in voltages_V:

        def rates(_: float, s: np.ndarray, u: float = u) -> list[float]:
            z, speed, q, v = s
            braked = speed * (1.0 + drag * abs(speed))
            mode = -2 * ZETA * OMEGA * v - OMEGA**2 * (q - speed)
            return [relaxation(z, u), (z + 0.818 * u - braked) / tau, v, mode]

        x = solve_ivp(rates, (0.0, step_s), x, **PRECISE).y[:, -1]
        found.append(x[2])
    return np.array(found)
