"""`bender gallery`: the command of the study of the same name."""

from bender_studies.gallery.command import EXAMPLE, HELP, add_arguments, run

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]
