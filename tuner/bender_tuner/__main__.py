"""`python -m bender_tuner` does the same as `bender tune`."""

import sys

from bender_cli.main import entry

sys.argv.insert(1, "tune")
entry()
