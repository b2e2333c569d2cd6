"""`bender diagnose`: the discrepancy workflow's own command."""

from bender_discrepancy.command import EXAMPLE, HELP, add_arguments, run

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]
