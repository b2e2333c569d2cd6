"""The hysteretic part of the Bouc-Wen model along a monotone stretch of its input.

    dh/du = alpha - (beta s sigma + gamma) |h|^n,     s the direction of u, sigma the sign of h

For n = 1 each stretch of one sign is an exponential; other exponents are integrated by Runge-Kutta along u.
"""

import math

MOST_HARDENED = 60.0


def _exponential(h: float, change: float, alpha: float, kappa: float) -> float:
    # a spring that hardens without end: far beyond any amplitude, but finite
    x = max(kappa * change, -MOST_HARDENED)
    drive = change if x == 0.0 else -math.expm1(-x) / kappa
    return h * math.exp(-x) + alpha * drive


def along(h: float, change: float, alpha: float, beta: float, gamma: float, exponent: float) -> float:
    """Return h after a monotone stretch of the voltage by `change`."""
    if change == 0.0 or (h == 0.0 and alpha == 0.0):
        return h
    if exponent != 1.0:
        return _along_any(h, change, alpha, beta, gamma, exponent)
    direction = math.copysign(1.0, change)
    sign = math.copysign(1.0, h) if h != 0.0 else math.copysign(1.0, alpha * change)
    # |h| = sigma h: dh/du = alpha - (beta s + sigma gamma) h on each side of h = 0
    kappa = beta * direction + sign * gamma
    after = _exponential(h, change, alpha, kappa)
    if h == 0.0 or after * sign >= 0.0:
        return after
    to_zero = -h / alpha if kappa == 0.0 else math.log1p(-kappa * h / alpha) / kappa
    return _exponential(0.0, change - to_zero, alpha, beta * direction - sign * gamma)


def _along_any(h: float, change: float, alpha: float, beta: float, gamma: float, exponent: float) -> float:
    signed = math.copysign(beta, change)

    def slope(x: float) -> float:
        return alpha - (math.copysign(signed, signed * x) + gamma) * abs(x) ** exponent

    steepest = (abs(alpha) / max(beta, 1e-300)) ** (1.0 / exponent)
    rate = exponent * (beta + abs(gamma)) * max(steepest, abs(h)) ** (exponent - 1.0)
    count = 1 + int(abs(change) * rate / 0.02)
    du = change / count
    for _ in range(count):
        k1 = slope(h)
        k2 = slope(h + 0.5 * du * k1)
        k3 = slope(h + 0.5 * du * k2)
        k4 = slope(h + du * k3)
        h += du * (k1 + 2.0 * (k2 + k3) + k4) / 6.0
    return h
