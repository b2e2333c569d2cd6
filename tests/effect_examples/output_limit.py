"""A limit of the output: the plain readings clipped, by numpy; stops as two systems of differential equations."""

from typing import Any

import numpy as np
from chain_oracle import OMEGA, PRECISE, ZETA, relaxation
from scipy.integrate import solve_ivp

PARAMETERS: list[dict[str, Any]] = [
    {"level_um": 10.0},
    {"level_um": 4.0, "remaining_slope": 0.3, "form": "below"},
    {"level_um": 8.0, "remaining_slope": 0.1, "rounding_um": 2.0},
    {"level_um": 10.0, "time_constant_s": 0.05},
    {"level_um": 6.0, "time_constant_s": 0.3, "form": "below"},
    {"level_um": 12.0, "other_level_um": 15.0, "time_constant_s": 0.1},
]
FAR_um = 1e6
VOLTS_V = np.array([20.0, -20.0, -45.0, 10.0, -10.0, 30.0, 0.0, -50.0, 5.0, 5.0, -5.0, 49.0])


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    if parameters.get("time_constant_s"):
        return with_stops(parameters, voltages_V, step_s)
    sign = -1.0 if parameters.get("form") == "below" else 1.0
    beyond = sign * np.array([0.0, *plain_um]) - parameters["level_um"]
    b = parameters.get("rounding_um", 0.0)
    lost = b * np.logaddexp(0.0, beyond / b) if b else np.maximum(beyond, 0.0)
    passed = sign * (beyond - (1.0 - parameters.get("remaining_slope", 0.0)) * lost)
    return passed[1:] - passed[0]


def with_stops(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float) -> np.ndarray:
    """The same of a lag behind the mode that stops hold."""
    tau, level, other = parameters["time_constant_s"], parameters["level_um"], parameters.get("other_level_um", FAR_um)
    stops = (other, -level) if parameters.get("form") == "below" else (level, -other)
    x, held = np.zeros(4), 0.0
    found = []
    for u in voltages_V:
        t = 0.0
        while t < step_s - 1e-13:

            def rates(_: float, s: np.ndarray, u: float = u, held: float = held) -> list[float]:
                z, q, v, y = s
                mode = -2 * ZETA * OMEGA * v - OMEGA**2 * (q - z - 0.818 * u)
                return [relaxation(z, u), v, mode, 0.0 if held else (q - y) / tau]

            def ends(_: float, s: np.ndarray, held: float = held) -> float:
                return (s[1] - held) * held if held else min(stops[0] - s[3], s[3] - stops[1])

            ends.terminal, ends.direction = True, -1.0  # pyright: ignore[reportFunctionMemberAccess]
            run = solve_ivp(rates, (t, step_s), x, events=ends, max_step=0.002, **PRECISE)
            t, x = float(run.t[-1]), run.y[:, -1].copy()
            if run.t_events[0].size:
                held = 0.0 if held else min(stops, key=lambda stop: abs(x[3] - stop))
                x[3] = held or x[3]
        found.append(x[3])
    return np.array(found)
