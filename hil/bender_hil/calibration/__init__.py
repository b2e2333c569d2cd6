"""What a pixel is worth, found from pictures of a stage micrometer."""

from .scale import Calibration

__all__ = ["Calibration"]
