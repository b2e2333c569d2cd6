"""`python -m bender_hil` does the same as `bender hil`."""

import sys

from bender_cli.main import entry

sys.argv.insert(1, "hil")
entry()
