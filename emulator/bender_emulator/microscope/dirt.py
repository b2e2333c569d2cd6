"""Things that lie about under a microscope: dust out of focus, grains, hairs.

Each function darkens `through`, the part of the light that comes through, in place, around one spot.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

Values = NDArray[np.float64]
Spot = tuple[float, float]

_SHARPNESS_PX = 1.2


def dust(through: Values, spot: Spot, rng: np.random.Generator) -> None:
    """A grain far out of focus: a soft disc with a darker rim."""
    radius, depth, edge = rng.uniform(6.0, 28.0), rng.uniform(0.03, 0.14), rng.uniform(1.5, 4.0)

    def shade(x: Values, y: Values) -> Values:
        distance = np.hypot(x, y)
        return depth * (0.7 * ndtr((radius - distance) / edge) + 0.5 * np.exp(-0.5 * ((distance - radius) / edge) ** 2))

    darken(through, spot, radius + 5.0 * edge, shade)


def speck(through: Values, spot: Spot, rng: np.random.Generator) -> None:
    """A grain in focus, longish, in any direction."""
    depth = rng.uniform(0.3, 0.8)
    length, breadth, turn = rng.uniform(1.0, 4.0), rng.uniform(0.7, 2.0), rng.uniform(0.0, math.pi)

    def shade(x: Values, y: Values) -> Values:
        along = x * math.cos(turn) + y * math.sin(turn)
        across = y * math.cos(turn) - x * math.sin(turn)
        return depth * np.exp(-0.5 * ((along / length) ** 2 + (across / breadth) ** 2))

    darken(through, spot, 4.5 * max(length, breadth), shade)


def grain(through: Values, spot: Spot, radius_px: float, depth: float) -> None:
    """A large grain in focus: a disc."""
    darken(through, spot, radius_px + 6.0, lambda x, y: depth * ndtr((radius_px - np.hypot(x, y)) / _SHARPNESS_PX))


def fibre(through: Values, spot: Spot, rng: np.random.Generator) -> None:
    """A hair: an arc of a circle, some pixels thick."""
    radius, half_width = rng.uniform(60.0, 400.0), rng.uniform(1.0, 3.0)
    depth, towards, length = rng.uniform(0.3, 0.7), rng.uniform(0.0, 2.0 * math.pi), rng.uniform(30.0, 200.0)

    def shade(x: Values, y: Values) -> Values:
        off = np.abs(np.hypot(x - radius * math.cos(towards), y - radius * math.sin(towards)) - radius)
        end = length / 2 - np.hypot(x, y)
        return depth * ndtr((half_width - off) / _SHARPNESS_PX) * ndtr(end / _SHARPNESS_PX)

    darken(through, spot, length / 2 + 8.0, shade)


def darken(through: Values, spot: Spot, reach_px: float, shade: Callable[[Values, Values], Values]) -> None:
    """Take away the part `shade(x, y)` of the light, with x and y from the spot, within `reach_px` of it."""
    height, width = through.shape
    left, right = (int(min(max(spot[0] + way * reach_px, 0), width)) for way in (-1, 1))
    top, bottom = (int(min(max(spot[1] + way * reach_px, 0), height)) for way in (-1, 1))
    if left < right and top < bottom:
        y, x = np.mgrid[top:bottom, left:right].astype(np.float64)
        through[top:bottom, left:right] *= 1.0 - shade(x - spot[0], y - spot[1])
