"""The paper's chain as differential equations, for oracles of effects; shares no code with the plant."""

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

OMEGA = 2 * math.pi * 104.37328430533374
ZETA = 0.02
PRECISE = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-10}
Force = Callable[[float, float, float], float]


def relaxation(z: float, u: float) -> float:
    """z' of equation (30)."""
    w = z + 0.818 * u
    return -0.48 * w + 1.652 * u - 0.22 * abs(w) - 0.124 * w * abs(w)


def with_force(
    voltages_V: np.ndarray, step_s: float, force: Force, growth: Callable[[float, float], float] | None = None
) -> np.ndarray:
    """Tip in um at the end of every held voltage, with a further force(q, q', x) over k, and x' = growth(q', x)."""
    x = np.zeros(4)
    found = []
    for u in voltages_V:

        def rates(_: float, s: np.ndarray, u: float = u) -> list[float]:
            z, q, v, more = s
            pull = q + force(q, v, more) - (z + 0.818 * u)
            slow = growth(v, more) if growth else 0.0
            return [relaxation(z, u), v, -2 * ZETA * OMEGA * v - OMEGA**2 * pull, slow]

        x = solve_ivp(rates, (0.0, step_s), x, **PRECISE).y[:, -1]
        found.append(x[1])
    return np.array(found)


def with_dry_friction(
    voltages_V: np.ndarray, step_s: float, friction: Callable[[float], float], breakaway: float
) -> np.ndarray:
    """The same with friction(|q'|) against the motion, and rest wherever no more than `breakaway` pulls."""
    z, q, v, sign = 0.0, 0.0, 0.0, 0.0
    found = []
    for u in voltages_V:
        t = 0.0
        while t < step_s - 1e-13:
            pull = z + 0.818 * u - q
            if sign == 0.0 and abs(pull) > breakaway:
                sign = math.copysign(1.0, pull)
            if sign == 0.0:

                def held(_: float, s: np.ndarray, u: float = u, q: float = q) -> float:
                    return abs(s[0] + 0.818 * u - q) - breakaway

                held.terminal, held.direction = True, 1.0  # pyright: ignore[reportFunctionMemberAccess]
                run = solve_ivp(lambda _, s, u=u: [relaxation(s[0], u)], (t, step_s), [z], events=held, **PRECISE)
                t, z = float(run.t[-1]), float(run.y[0, -1])
                if run.t_events[0].size:
                    sign = math.copysign(1.0, z + 0.818 * u - q)
                continue

            def sliding(_: float, s: np.ndarray, u: float = u, sign: float = sign) -> list[float]:
                pull = s[1] + sign * friction(abs(s[2])) - (s[0] + 0.818 * u)
                return [relaxation(s[0], u), s[2], -2 * ZETA * OMEGA * s[2] - OMEGA**2 * pull]

            def at_rest(_: float, s: np.ndarray, sign: float = sign) -> float:
                return sign * s[2]

            at_rest.terminal, at_rest.direction = True, -1.0  # pyright: ignore[reportFunctionMemberAccess]
            run = solve_ivp(sliding, (t, step_s), [z, q, v], events=at_rest, max_step=2e-4, **PRECISE)
            t, (z, q, v) = float(run.t[-1]), (float(x) for x in run.y[:, -1])
            if run.t_events[0].size:
                v, sign = 0.0, 0.0
        found.append(q)
    return np.array(found)
