"""`bender calibrate`: what a pixel is worth, from pictures of a stage micrometer."""

from bender_hil.calibration.command import EXAMPLE, HELP, add_arguments, run

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]
