"""`python -m bender_cli` does the same as `bender`."""

from bender_cli.start import entry

entry()
