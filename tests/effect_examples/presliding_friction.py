"""Dahl's friction of a velocity, with the paper's chain as one system of differential equations."""

from typing import Any

import numpy as np
from chain_oracle import OMEGA, PRECISE, ZETA, relaxation
from scipy.integrate import solve_ivp

PARAMETERS: list[dict[str, Any]] = [
    {"force_um": 3.0, "slip_V_s": 0.8},
    {"force_um": -1.0, "slip_V_s": 5.0},
]
VOLTS_V = np.array([20.0, -20.0, -45.0, 10.0, -10.0, 30.0, 0.0, -50.0, 5.0, 5.0, -5.0, 49.0])


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    del plain_um
    force, slip = parameters["force_um"], parameters["slip_V_s"]
    x = np.zeros(4)
    found = []
    for u in voltages_V:

        def rates(_: float, s: np.ndarray, u: float = u) -> list[float]:
            w, q, v, z = s
            pull = -2 * ZETA * OMEGA * v - OMEGA**2 * (q - (w + 0.818 * u) - force * z)
            return [relaxation(w, u), v, pull, (u - abs(u) * z) / slip]

        x = solve_ivp(rates, (0.0, step_s), x, **PRECISE).y[:, -1]
        found.append(x[1])
    return np.array(found)
