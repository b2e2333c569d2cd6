"""`bender investigate`: the command of its room."""

from bender_investigate.command import EXAMPLE, HELP, add_arguments, run

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]
