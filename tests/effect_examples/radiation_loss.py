"""A radiating body between the film and the mode, as one system of differential equations."""

from typing import Any

import numpy as np
from chain_oracle import OMEGA, PRECISE, ZETA, relaxation
from scipy.integrate import solve_ivp

PARAMETERS: list[dict[str, Any]] = [
    {"time_constant_s": 0.05, "rest_um": 60.0},
    {"time_constant_s": 0.4, "rest_um": 30.0},
    {"time_constant_s": 0.2, "rest_um": 12.0},
]


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    del plain_um
    tau, rest = parameters["time_constant_s"], parameters["rest_um"]
    x = np.zeros(4)
    found = []
    for u in voltages_V:

        def rates(_: float, s: np.ndarray, u: float = u) -> list[float]:
            z, warm, q, v = s
            lost = 0.25 * ((rest + warm) ** 4 - rest**4) / rest**3
            mode = -2 * ZETA * OMEGA * v - OMEGA**2 * (q - warm)
            return [relaxation(z, u), (z + 0.818 * u - lost) / tau, v, mode]

        x = solve_ivp(rates, (0.0, step_s), x, **PRECISE).y[:, -1]
        found.append(x[2])
    return np.array(found)
