"""`bender demo`: the demonstration's own command."""

from bender_studies.demonstration.command import EXAMPLE, HELP, add_arguments, run

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]
