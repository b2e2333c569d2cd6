"""`bender live RUN`: the page of the bench, for a run that is over."""

from bender_hil.live.command import EXAMPLE, HELP, add_arguments, run

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]
