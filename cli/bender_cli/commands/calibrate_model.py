"""`bender calibrate-model RECORD... --fmu F`: parameters of an FMU from records."""

from bender_discrepancy.foreign.calibrate_command import EXAMPLE, HELP, add_arguments, run

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]
