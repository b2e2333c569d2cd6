"""What a pixel is worth, found from pictures of a stage micrometer."""

from bender_hil.calibration.scale import Calibration

__all__ = ["Calibration"]
