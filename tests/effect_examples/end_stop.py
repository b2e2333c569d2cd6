"""End stops on the lag between film and mode: motion and rest as two systems of differential equations."""

from typing import Any

import numpy as np
from chain_oracle import OMEGA, PRECISE, ZETA, relaxation
from scipy.integrate import solve_ivp

PARAMETERS: list[dict[str, Any]] = [
    {"time_constant_s": 0.05, "highest_um": 10.0},
    {"time_constant_s": 0.3, "lowest_um": 6.0},
    {"time_constant_s": 0.1, "highest_um": 12.0, "lowest_um": 15.0},
]
FAR_um = 1e6


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    del plain_um
    tau = parameters["time_constant_s"]
    stops = parameters.get("highest_um", FAR_um), -parameters.get("lowest_um", FAR_um)
    x, held = np.zeros(4), 0.0
    found = []
    for u in voltages_V:
        t = 0.0
        while t < step_s - 1e-13:
            pull = x[0] + 0.818 * u
            if held and (pull - held) * held < 0.0:
                held = 0.0

            def rates(_: float, s: np.ndarray, u: float = u, held: float = held) -> list[float]:
                z, y, q, v = s
                moved = 0.0 if held else (z + 0.818 * u - y) / tau
                return [relaxation(z, u), moved, v, -2 * ZETA * OMEGA * v - OMEGA**2 * (q - y)]

            def ends(_: float, s: np.ndarray, u: float = u, held: float = held) -> float:
                if held:
                    return (s[0] + 0.818 * u - held) * held
                return min(stops[0] - s[1], s[1] - stops[1])

            ends.terminal, ends.direction = True, -1.0  # pyright: ignore[reportFunctionMemberAccess]
            run = solve_ivp(rates, (t, step_s), x, events=ends, max_step=0.01, **PRECISE)
            t, x = float(run.t[-1]), run.y[:, -1].copy()
            if run.t_events[0].size:
                held = 0.0 if held else min(stops, key=lambda stop: abs(x[1] - stop))
                x[1] = held or x[1]
        found.append(x[2])
    return np.array(found)
