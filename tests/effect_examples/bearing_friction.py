"""Dry friction on the lag between film and mode: motion and rest as two systems of differential equations."""

import math
from typing import Any

import numpy as np
from chain_oracle import OMEGA, PRECISE, ZETA, relaxation
from scipy.integrate import solve_ivp

PARAMETERS: list[dict[str, Any]] = [
    {"time_constant_s": 0.05, "friction_um": 2.0},
    {"time_constant_s": 0.3, "friction_um": 5.0},
    {"time_constant_s": 0.2, "friction_um": 3.0, "drag_1_per_um": 0.05},
    {"time_constant_s": 0.2, "friction_um": 3.0, "load_um": -1.0, "form": "place"},
]


def oracle(parameters: dict[str, Any], voltages_V: np.ndarray, step_s: float, plain_um: np.ndarray) -> np.ndarray:
    """The readings in um at the end of every held voltage; `plain_um` are those without the effect."""
    del plain_um
    tau, dry, drag = parameters["time_constant_s"], parameters["friction_um"], parameters.get("drag_1_per_um", 0.0)
    load, place = parameters.get("load_um", 0.0), parameters.get("form") == "place"
    x, sign = np.zeros(5), 0.0
    found = []
    for u in voltages_V:
        t = 0.0
        while t < step_s - 1e-13:
            pull = x[0] + 0.818 * u + load
            if sign == 0.0 and abs(pull) > dry:
                sign = math.copysign(1.0, pull)

            def rates(_: float, s: np.ndarray, u: float = u, sign: float = sign) -> list[float]:
                z, y, q, v, way = s
                turned = (z + 0.818 * u + load - y * (1.0 + drag * abs(y)) - sign * dry) / tau if sign else 0.0
                pushed = way if place else y
                return [relaxation(z, u), turned, v, -2 * ZETA * OMEGA * v - OMEGA**2 * (q - pushed), y / tau]

            def ends(_: float, s: np.ndarray, u: float = u, sign: float = sign) -> float:
                return sign * s[1] if sign else dry - abs(s[0] + 0.818 * u + load)

            ends.terminal, ends.direction = True, -1.0  # pyright: ignore[reportFunctionMemberAccess]
            run = solve_ivp(rates, (t, step_s), x, events=ends, max_step=0.01, **PRECISE)
            t, x = float(run.t[-1]), run.y[:, -1].copy()
            if run.t_events[0].size:
                sign = 0.0 if sign else math.copysign(1.0, x[0] + 0.818 * u + load)
                x[1] = 0.0
        found.append(x[2])
    return np.array(found)
