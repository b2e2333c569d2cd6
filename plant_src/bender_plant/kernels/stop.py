"""A lag between two stops: what moves rests there, and comes off as soon as the drive turns."""

from bender_plant.kernels.first_order_lag import lag_step
from bender_plant.parabola import INSTANT, first_crossing, value

ROUNDING = 1e-9
"""Of a stop: what ended there did so within rounding."""
TURNS = 2


def held_at(y: float, high: float, low: float) -> float:
    """Return 1 at the upper stop, -1 at the lower one, else 0."""
    if y >= high * (1.0 - ROUNDING):
        return 1.0
    return -1.0 if y <= -low * (1.0 - ROUNDING) else 0.0


def reached(y: float, tau: float, stop: float, h: float, w0: float, wm: float, w1: float) -> float:
    """Return the fraction of the sub-step at which a stop is reached, 1 for none: by a parabola, then by Newton."""
    middle, end = lag_step(y, tau, h, w0, wm, w1)
    at = first_crossing(y, middle, end, stop)
    if at == 1.0:
        return at
    for _ in range(TURNS):
        here = value(w0, wm, w1, at)
        _, y_at = lag_step(y, tau, at * h, w0, value(w0, wm, w1, 0.5 * at), here)
        moves = (here - y_at) * h / tau
        if moves != 0.0:
            at = min(max(at + (stop - y_at) / moves, INSTANT), 1.0 - INSTANT)
    return at


def stopped(
    y: float, tau: float, high: float, low: float, h: float, w0: float, wm: float, w1: float
) -> tuple[float, float, float]:  # fmt: skip
    """Return the place at the start, the middle and the end of a sub-step in which no stop is reached or left."""
    y = min(max(y, -low), high)
    held = held_at(y, high, low)
    stop = high if held > 0.0 else -low
    if held != 0.0 and held * wm >= held * stop:
        return stop, stop, stop
    middle, end = lag_step(y, tau, h, w0, wm, w1)
    return y, min(max(middle, -low), high), min(max(end, -low), high)
