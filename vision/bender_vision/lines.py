"""A straight line through points of which some are wrong."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]

_TUKEY = 4.685
_ROUNDS = 5


@dataclass(frozen=True, slots=True)
class Line:
    """y = height + slope * (x - middle).

    Attributes:
        middle, height, slope: of the line.
        rms: of the distances of the points that count, weighted.
        count: points that count, a sum of weights.
        inertia: weighted sum of squares of x - middle.
        weights: of the points, 0 to 1.
    """

    middle: float
    height: float
    slope: float
    rms: float
    count: float
    inertia: float
    weights: Values

    def at(self, x: Values) -> Values:
        """Height of the line at x."""
        return self.height + self.slope * (x - self.middle)

    def value(self, x: float) -> float:
        """Height of the line at x."""
        return self.height + self.slope * (x - self.middle)

    def spread_at(self, x: float) -> float:
        """Standard deviation of `value(x)` for points with independent errors."""
        return self.rms * math.sqrt(1.0 / self.count + (x - self.middle) ** 2 / self.inertia)


def robust_line(x: Values, y: Values, least_scale: float) -> Line:
    """Fit by iterated least squares with Tukey's biweight.

    Args:
        x: of at least two points, not all the same.
        y: of the points.
        least_scale: no point nearer to the line than a few of these is doubted.
    """
    weights = np.ones_like(x)
    line = _weighted(x, y, weights)
    for _ in range(_ROUNDS):
        distance = np.abs(y - line.at(x))
        scale = max(1.4826 * middle_of(distance), least_scale)
        weights = np.square(np.maximum(0.0, 1.0 - np.square(distance / (_TUKEY * scale))))
        if np.count_nonzero(weights) < 2:
            return line
        line = _weighted(x, y, weights)
    return line


def middle_of(values: NDArray[np.generic]) -> float:
    """The upper median; in a loop over few values it costs a fifth of numpy's."""
    half = len(values) // 2
    return float(np.partition(values, half)[half])


def _weighted(x: Values, y: Values, weights: Values) -> Line:
    count = float(weights.sum())
    middle = float(weights @ x) / count
    height = float(weights @ y) / count
    offset = x - middle
    inertia = max(float(weights @ (offset * offset)), 1e-12)
    slope = float(weights @ (offset * (y - height))) / inertia
    residual = y - height - slope * offset
    rms = math.sqrt(float(weights @ (residual * residual)) / max(count - 2.0, 1.0))
    return Line(middle, height, slope, rms, count, inertia, weights)
