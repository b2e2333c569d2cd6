"""A mode of vibration with dry friction, quadratic drag or hysteresis in its restoring force.

    q'' + 2 zeta omega q' + omega^2 (q + k_2 q^2 + k_3 q^3 + z + d q' |q'| + f(q') - w) = 0
    z' = alpha q' - beta |q'| z - gamma q' |z|
    f = sign(q') (f_c + (f_s - f_c) exp(-(q' / v_s)^2)) in motion; at rest whatever holds it, up to f_s

All in displacement: a force over the stiffness. k_3 may bend, see `vibration_mode.cubic_at`. Between two instants of
rest the friction does not change its sign; a sub-step is cut where the mode comes to rest and where it breaks away, so
an end is exact for f_s = f_c.
"""

import math

from bender_plant.kernels.bouc_wen import along
from bender_plant.kernels.vibration_mode import cubic_at, mode_factors, stiffened_mode, stiffness_at
from bender_plant.parabola import cut, first_crossing

# instants of rest within one sub-step, which is a small part of a period
MOST_RESTS = 12
ROOT_STEPS = 14
CONVERGED = 1e-13

_Load = tuple[float, float, float, float, float, float, float, float, float, float]


def dry_friction(v: float, kinetic: float, breakaway: float, speed: float) -> float:
    """Return the size of the friction in motion."""
    x = v / speed
    return kinetic + (breakaway - kinetic) * math.exp(-x * x)


def sliding_step(
    q: float, v: float, z: float, sign: float, omega: float, zeta: float, load: _Load,
    h: float, w0: float, wm: float, w1: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Advance a mode that slides one way; returns (q at h, q' at h, z at h, q at h/2). No friction where sign is 0."""
    quadratic, cubic, bend, kinetic, breakaway, speed, drag, alpha, beta, gamma = load
    x0 = z + sign * dry_friction(v, kinetic, breakaway, speed) + drag * v * abs(v)
    xm, x1 = x0, x0
    end, rate, middle, after = q, v, q, z
    stiffness = stiffness_at(q, quadratic, cubic, bend)
    root = math.sqrt(stiffness)
    factors = mode_factors(omega * root, zeta / root, h)
    for _ in range(4):
        end, rate, middle = stiffened_mode(
            q, v, zeta, quadratic, cubic, bend, stiffness, factors, h, w0 - x0, wm - xm, w1 - x1
        )
        rate_m = 1.5 * (end - q) / h - 0.25 * (v + rate)
        z_m = along(z, middle - q, alpha, beta, gamma, 1.0)
        after = along(z_m, end - middle, alpha, beta, gamma, 1.0)
        xm = z_m + sign * dry_friction(rate_m, kinetic, breakaway, speed) + drag * rate_m * abs(rate_m)
        x1 = after + sign * dry_friction(rate, kinetic, breakaway, speed) + drag * rate * abs(rate)
    return end, rate, after, middle


def rest_within(
    q: float, v: float, z: float, sign: float, omega: float, zeta: float, load: _Load,
    h: float, w0: float, wm: float, w1: float, rate: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Return (fraction, q, z) at the instant of rest of a mode that starts with v and would end with another sign."""
    low, high = 0.0, 1.0
    at_low, at_high = sign * v, sign * rate
    if at_low <= 0.0:
        # it has just broken away: where it is still on its way after half of the time, it rests in the other half
        left, now, _, _ = cut(w0, wm, w1, 0.5)
        _, rate_m, _, _ = sliding_step(q, v, z, sign, omega, zeta, load, 0.5 * h, w0, left, now)
        if sign * rate_m <= 0.0:
            return 0.5, q, z
        low, at_low = 0.5, sign * rate_m
    fraction, there, z_there = high, q, z
    for _ in range(ROOT_STEPS):
        fraction = low + (high - low) * at_low / (at_low - at_high)
        left, now, _, _ = cut(w0, wm, w1, fraction)
        there, rate_m, z_there, _ = sliding_step(q, v, z, sign, omega, zeta, load, fraction * h, w0, left, now)
        found = sign * rate_m
        if abs(found) * h <= CONVERGED * (1.0 + abs(q)) or (high - low) < CONVERGED:
            break
        if found > 0.0:
            low, at_low = fraction, found
            at_high *= 0.5
        else:
            high, at_high = fraction, found
            at_low *= 0.5
    return fraction, there, z_there


def rubbing_step(
    q: float, v: float, z: float, omega: float, zeta: float, load: _Load, h: float, w0: float, wm: float, w1: float
) -> tuple[float, float, float]:
    """Advance a mode with dry friction through all its instants of rest; returns (q, q', z) at h."""
    quadratic, cubic, bend, breakaway = load[0], load[1], load[2], load[4]
    for _ in range(MOST_RESTS):
        sign = math.copysign(1.0, v)
        if v == 0.0:
            force = q + quadratic * q * q + cubic_at(q, cubic, bend) * q * q * q + z
            if abs(w0 - force) <= breakaway:
                fraction = min(
                    first_crossing(w0, wm, w1, force + breakaway), first_crossing(w0, wm, w1, force - breakaway)
                )
                if not fraction < 1.0:
                    return q, 0.0, z
                _, w0, wm, w1 = cut(w0, wm, w1, fraction)
                h *= 1.0 - fraction
            sign = math.copysign(1.0, w0 - force)
        end, rate, after, _ = sliding_step(q, v, z, sign, omega, zeta, load, h, w0, wm, w1)
        if sign * rate >= 0.0 or not math.isfinite(rate):
            return end, rate, after
        fraction, q, z = rest_within(q, v, z, sign, omega, zeta, load, h, w0, wm, w1, rate)
        v = 0.0
        if not fraction < 1.0:
            break
        _, w0, wm, w1 = cut(w0, wm, w1, fraction)
        h *= 1.0 - fraction
    return q, v, z


def loaded_mode_step(
    q: float, v: float, z: float, omega: float, zeta: float, load: _Load, h: float, w0: float, wm: float, w1: float
) -> tuple[float, float, float, float]:
    """Advance a mode by h under the parabola through w0, wm, w1; returns (q, q', z) at h, and q at h/2."""
    if load[4] <= 0.0:
        return sliding_step(q, v, z, 0.0, omega, zeta, load, h, w0, wm, w1)
    left, now, right, _ = cut(w0, wm, w1, 0.5)
    middle, rate, after = rubbing_step(q, v, z, omega, zeta, load, 0.5 * h, w0, left, now)
    end, rate, after = rubbing_step(middle, rate, after, omega, zeta, load, 0.5 * h, now, right, w1)
    return end, rate, after, middle
