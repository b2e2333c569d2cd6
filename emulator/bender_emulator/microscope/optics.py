"""What a blurred, moving edge looks like: profiles that need no picture to be convolved."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

STEPS_PER_PX = 64
"""Resolution of the tables."""
# A pixel sums the light over its own width, which blurs like a Gaussian of this variance.
_PIXEL_VARIANCE = 1.0 / 12.0


def step(position_px: NDArray[np.float64], blur_px: float, smear_px: float = 0.0) -> NDArray[np.float64]:
    """A step from 0 to 1 at the origin, seen through a Gaussian blur and smeared by a steady motion.

    Without motion it is the normal distribution function; the motion's mean over the exposure is
    (G(x + m/2) - G(x - m/2)) / m with the antiderivative G(x) = x Phi(x / s) + s phi(x / s).

    Args:
        position_px: where, along the edge's normal.
        blur_px: standard deviation of the optics; the pixel's own width is added.
        smear_px: how far the edge moves during the exposure.
    """
    spread = math.sqrt(blur_px**2 + _PIXEL_VARIANCE)
    smear = abs(smear_px)
    if smear < 0.01 * spread:
        return ndtr(position_px / spread)

    def antiderivative(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return x * ndtr(x / spread) + spread / math.sqrt(2.0 * math.pi) * np.exp(-0.5 * (x / spread) ** 2)

    return (antiderivative(position_px + smear / 2) - antiderivative(position_px - smear / 2)) / smear


def bar(
    position_px: NDArray[np.float64], width_px: float, blur_px: float, smear_px: float = 0.0
) -> NDArray[np.float64]:
    """A bar of height 1 and the given width, centred at the origin, blurred and smeared."""
    left = step(position_px + width_px / 2, blur_px, smear_px)
    return left - step(position_px - width_px / 2, blur_px, smear_px)


class Table:
    """A profile in steps of 1 / STEPS_PER_PX px from -reach to +reach, looked up for whole pictures at once."""

    def __init__(self, values: NDArray[np.float64], reach_px: float) -> None:
        self._values = values.astype(np.float32)
        self._reach_px = reach_px

    @classmethod
    def places(cls, reach_px: float) -> NDArray[np.float64]:
        """Where the entries of a table of this reach lie."""
        count = 2 * math.ceil(reach_px) * STEPS_PER_PX + 1
        return (np.arange(count) - (count - 1) / 2) / STEPS_PER_PX

    def __call__(self, position_px: NDArray[np.floating]) -> NDArray[np.float32]:
        """The profile there; beyond the reach it keeps its last value."""
        middle = (len(self._values) - 1) / 2
        index = (position_px * np.float32(STEPS_PER_PX) + np.float32(middle + 0.5)).astype(np.int32)
        return self._values.take(index, mode="clip")
