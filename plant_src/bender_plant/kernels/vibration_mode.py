"""One mode of vibration under a parabola, and one whose restoring force is not in proportion to its displacement."""

import math
from functools import lru_cache

STIFFNESS_LEVELS, RUNAWAY = 32.0, 1e9
"""So many levels of stiffness from none to that of the mode at rest, as far apart beyond; no spring is so stiff."""

_Factors = tuple[float, float, float, float, float, float, float, float, float]


@lru_cache(maxsize=256)
def mode_factors(omega: float, zeta: float, h: float) -> _Factors:
    """Return what does not depend on where a mode is: its rates, and how it rings freely over h/2 and over h.

    (decay rate, ringing rate, 1/omega, 1/ringing rate, 1/h, decayed cosine and sine at h/2, the same at h)

    Even rows are cut into sub-steps of few lengths again and again; the last ones are kept.
    """
    decay_rate = zeta * omega
    omega_d = omega * math.sqrt(1.0 - zeta * zeta)
    half = 0.5 * h
    decay, cosine, sine = math.exp(-decay_rate * half), math.cos(omega_d * half), math.sin(omega_d * half)
    whole = decay * decay
    return (
        decay_rate, omega_d, 1.0 / omega, 1.0 / omega_d, 1.0 / h, decay * cosine, decay * sine,
        whole * (1.0 - 2.0 * sine * sine), whole * (2.0 * sine * cosine),
    )  # fmt: skip


def driven_mode(
    q: float, v: float, zeta: float, factors: _Factors, h: float, w0: float, wm: float, w1: float
) -> tuple[float, float, float]:
    """Advance one mode by h under the parabola through w0, wm, w1; returns (q at h, q' at h, q at h/2)."""
    decay_rate, omega_d, over_omega, over_omega_d, over_h, cosine_m, sine_m, cosine, sine = factors
    slope = (4.0 * wm - 3.0 * w0 - w1) * over_h
    bend = 2.0 * (w0 + w1 - 2.0 * wm) * over_h * over_h
    # q_p = A + B t + C t^2 with C = bend solves the equation under w0 + slope t + bend t^2
    B = slope - 4.0 * zeta * bend * over_omega
    A = w0 - 2.0 * (zeta * B + bend * over_omega) * over_omega
    x = q - A
    s = (v - B + decay_rate * x) * over_omega_d
    half = 0.5 * h
    middle = A + half * (B + bend * half) + (x * cosine_m + s * sine_m)
    free = x * cosine + s * sine
    rate = omega_d * (s * cosine - x * sine) - decay_rate * free
    return A + h * (B + bend * h) + free, B + 2.0 * bend * h + rate, middle


def mode_step(
    q: float, v: float, omega: float, zeta: float, h: float, w0: float, wm: float, w1: float
) -> tuple[float, float, float]:
    """Advance one mode by h under the parabola through w0, wm, w1; returns (q at h, q' at h, q at h/2)."""
    return driven_mode(q, v, zeta, mode_factors(omega, zeta, h), h, w0, wm, w1)


def cubic_at(q: float, cubic: float, bend: float) -> float:
    """Return k_3 of a bent cubic force at q: k_3 / (1 + b q^2) for b > 0, k_3 sqrt(1 + 2 |b| q^2) for b < 0."""
    if bend == 0.0:
        return cubic
    if bend > 0.0:
        return cubic / (1.0 + bend * q * q)
    return cubic * math.sqrt(1.0 - 2.0 * bend * q * q)


def stiffness_at(q: float, quadratic: float, cubic: float, bend: float) -> float:
    """Return the slope of the restoring force q + k_2 q^2 + k_3 q^3, bent; 1 where it all but vanishes."""
    square = q * q
    slope = 3.0 * cubic * square
    if bend > 0.0:
        below = 1.0 + bend * square
        slope = cubic * square * (3.0 + bend * square) / (below * below)
    if bend < 0.0:
        root = math.sqrt(1.0 - 2.0 * bend * square)
        slope = cubic * square * (3.0 * root - 2.0 * bend * square / root)
    stiffness = 1.0 + slope + 2.0 * quadratic * q
    return 1.0 if stiffness < 0.1 else stiffness


def nearest_level(stiffness: float) -> float:
    """Return the nearest of few stiffnesses, whose factors are kept; one that runs away as it is."""
    if not stiffness < RUNAWAY:
        return stiffness
    return max(1.0, math.floor(stiffness * STIFFNESS_LEVELS + 0.5)) / STIFFNESS_LEVELS


def stiffened_mode(
    q: float, v: float, zeta: float, quadratic: float, cubic: float, bend: float,
    stiffness: float, factors: _Factors, h: float, w0: float, wm: float, w1: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Advance a mode with the force q + k_2 q^2 + k_3 q^3, bent; `factors` are of the mode as stiff as it starts."""
    zeta, over, excess = zeta / math.sqrt(stiffness), 1.0 / stiffness, stiffness - 1.0
    start = (w0 - q * (q * (cubic_at(q, cubic, bend) * q + quadratic) - excess)) * over
    m = start + (wm - w0) * over
    e = start + (w1 - w0) * over
    end, rate, middle = driven_mode(q, v, zeta, factors, h, start, m, e)
    if quadratic == 0.0 and cubic == 0.0:
        return end, rate, middle
    for _ in range(3):
        m = (wm - middle * (middle * (cubic_at(middle, cubic, bend) * middle + quadratic) - excess)) * over
        e = (w1 - end * (end * (cubic_at(end, cubic, bend) * end + quadratic) - excess)) * over
        end, rate, middle = driven_mode(q, v, zeta, factors, h, start, m, e)
    return end, rate, middle


def stiff_mode_step(
    q: float, v: float, omega: float, zeta: float, quadratic: float, cubic: float, bend: float,
    h: float, w0: float, wm: float, w1: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Advance a mode with the force q + k_2 q^2 + k_3 q^3, bent as `cubic_at` says.

    The force is a straight line through its value at the start of the sub-step, nearly as steep as it is there, which
    is solved exactly, and what departs from it, which joins the drive and is found by iteration.
    """
    stiffness = nearest_level(stiffness_at(q, quadratic, cubic, bend))
    root = math.sqrt(stiffness)
    factors = mode_factors(omega * root, zeta / root, h)
    return stiffened_mode(q, v, zeta, quadratic, cubic, bend, stiffness, factors, h, w0, wm, w1)
