"""`bender watch`: the command of the room that keeps a model beside the running device."""

from bender_watch.command import EXAMPLE, HELP, add_arguments, run

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]
