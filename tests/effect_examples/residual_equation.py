"""An equation for the residual, with the paper's chain as one system of differential equations."""

from typing import Any

import numpy as np
from chain_oracle import OMEGA, PRECISE, ZETA, relaxation
from scipy.integrate import solve_ivp

PARAMETERS: list[dict[str, Any]] = [
    {"terms": ("r", "v", "y^2"), "coefficients": (-2.0, 0.3, 0.02), "gives": "rate"},
    {"terms": ("v'", "r |y'|", "|r| y'", "1"), "coefficients": (0.06, -0.02, 0.005, 1.5), "gives": "rate"},
    {"terms": ("v^2", "y |y|", "y'"), "coefficients": (0.001, -0.002, 1e-4), "gives": "value"},
    {"terms": ("v",), "coefficients": (0.1,), "gives": "value", "highest_voltage_V": 30.0, "largest_residual_um": 2.5},
]


def _sum(parameters: dict[str, Any], r: float, u: float, y: float, speed: float) -> float:
    """The right-hand side while the voltage is held, each term as it is read."""
    v = min(u, parameters.get("highest_voltage_V", 1e9))
    known = {
        "r": r, "v": v, "y^2": y * y, "v'": 0.0, "r |y'|": r * abs(speed), "|r| y'": abs(r) * speed,
        "1": 1.0, "v^2": v * v,
        "y |y|": y * abs(y), "y'": speed,
    }  # fmt: skip
    return sum(c * known[x] for x, c in zip(parameters["terms"], parameters["coefficients"], strict=True))


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    del plain_um
    jumps = dict(zip(parameters["terms"], parameters["coefficients"], strict=True)).get("v'", 0.0)
    runs = parameters["gives"] == "rate"
    x, last = np.zeros(4), 0.0
    found = []
    for u in voltages_V:
        x[3] += jumps * (u - last)
        last = u

        def rates(_: float, s: np.ndarray, u: float = u) -> list[float]:
            w, q, v, r = s
            pull = -2 * ZETA * OMEGA * v - OMEGA**2 * (q - (w + 0.818 * u))
            return [relaxation(w, u), v, pull, _sum(parameters, r, u, q, v) if runs else 0.0]

        x = solve_ivp(rates, (0.0, step_s), x, **PRECISE).y[:, -1]
        r = x[3] if runs else _sum(parameters, 0.0, u, x[1], x[2])
        found.append(
            x[1] + min(max(r, -parameters.get("largest_residual_um", 1e9)), parameters.get("largest_residual_um", 1e9))
        )
    return np.array(found)
