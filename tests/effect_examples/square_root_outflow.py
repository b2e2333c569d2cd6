"""A tank that drains by Torricelli's law between the film and the mode, as one system of differential equations."""

import math
from typing import Any

import numpy as np
from chain_oracle import OMEGA, PRECISE, ZETA, relaxation
from scipy.integrate import solve_ivp

PARAMETERS: list[dict[str, Any]] = [
    {"time_constant_s": 0.05, "head_um": 10.0},
    {"time_constant_s": 0.4, "head_um": 2.0},
    {"time_constant_s": 0.1, "head_um": 6.0, "second_time_constant_s": 0.3, "second_head_um": 3.0},
]


def flow(level: float, head: float) -> float:
    """Torricelli's outflow over the gain of the inflow."""
    return 2.0 * head * (math.sqrt(max(1.0 + level / head, 0.0)) - 1.0)


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    del plain_um
    tau, head = parameters["time_constant_s"], parameters["head_um"]
    second_tau, second_head = parameters.get("second_time_constant_s", 0.0), parameters.get("second_head_um", 0.0)
    x = np.zeros(5)
    found = []
    for u in voltages_V:

        def rates(_: float, s: np.ndarray, u: float = u) -> list[float]:
            z, level, q, v, below = s
            out, filled = flow(level, head), 0.0
            acting = level
            if second_tau:
                filled, acting = (out - flow(below, second_head)) / second_tau, below
            mode = -2 * ZETA * OMEGA * v - OMEGA**2 * (q - acting)
            return [relaxation(z, u), (z + 0.818 * u - out) / tau, v, mode, filled]

        x = solve_ivp(rates, (0.0, step_s), x, **PRECISE).y[:, -1]
        found.append(x[2])
    return np.array(found)
