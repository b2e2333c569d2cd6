"""A number by which the misfit falls in jumps, moved by finer and finer parts of itself.

A command flips to the next level of a quantiser where the step is off by the command's distance to the middle of two
levels, over the level. Between two flips nothing says where the next one lies: a slope does not lead there.
"""

import math
from collections.abc import Callable

FINER_AND_FINER = (1e-3, 4e-4, 1.6e-4, 6e-5, 2.5e-5, 1e-5, 4e-6)
"""Parts of the number by which it is moved, one after the other."""
PLACES = (-1.0, -0.5, 0.5, 1.0)
WIDER, HALVED = 4.0, 3
"""Times as far away an end of what fits alike is sought next; so often the factor between is halved."""


def minimise_in_jumps(value: float, square: float, square_at: Callable[[float], float]) -> tuple[float, float]:
    """Return the value around a given one at which the square is least, and that square.

    Args:
        value: to set out from.
        square: there.
        square_at: of another value; inf where there is none.
    """
    best, least = value, square
    for width in FINER_AND_FINER:
        middle = best
        for place in PLACES:
            tried = middle * (1.0 + place * width)
            found = square_at(tried)
            if found < least:
                best, least = tried, found
    return best, least


def middle_of_equal_fits(value: float, most: float, square_at: Callable[[float], float]) -> float:
    """Return the middle of the values around a given one whose square is at most as large as said.

    Which of them leaves least is up to the noise: close to an end, a command that acts in rows of another kind may lie
    on the wrong level.

    Args:
        value: that leaves least.
        most: square of what fits alike.
        square_at: of another value; inf where there is none.
    """
    low, high = (_end(value, sign, most, square_at) for sign in (-1.0, 1.0))
    middle = 0.5 * (low + high)
    return middle if square_at(middle) <= most else value


def _end(value: float, sign: float, most: float, square_at: Callable[[float], float]) -> float:
    """Return the last value on one side, as far as the widest part, up to which the square is no larger."""
    inside, outside = 0.0, FINER_AND_FINER[-1]
    while square_at(value * (1.0 + sign * outside)) <= most:
        inside = outside
        if inside >= FINER_AND_FINER[0]:
            return value * (1.0 + sign * inside)
        outside *= WIDER
    for _ in range(HALVED if inside else 0):
        part = math.sqrt(inside * outside)
        if square_at(value * (1.0 + sign * part)) <= most:
            inside = part
        else:
            outside = part
    return value * (1.0 + sign * inside)
