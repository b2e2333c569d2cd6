"""The lags of a plant, with the paper's chain as one system of differential equations."""

from typing import Any

import numpy as np
from chain_oracle import OMEGA, PRECISE, ZETA, relaxation
from scipy.integrate import solve_ivp

PARAMETERS: list[dict[str, Any]] = [
    {"time_constant_s": 0.05},
    {"time_constant_s": 0.02, "second_time_constant_s": 0.3},
]


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    del plain_um
    first, second = parameters["time_constant_s"], parameters.get("second_time_constant_s", 0.0)
    x = np.zeros(5)
    found = []
    for u in voltages_V:

        def rates(_: float, s: np.ndarray, u: float = u) -> list[float]:
            z, a, b, q, v = s
            behind = b if second else a
            slower = (a - b) / second if second else 0.0
            pull = -2 * ZETA * OMEGA * v - OMEGA**2 * (q - behind)
            return [relaxation(z, u), (z + 0.818 * u - a) / first, slower, v, pull]

        x = solve_ivp(rates, (0.0, step_s), x, **PRECISE).y[:, -1]
        found.append(x[3])
    return np.array(found)
