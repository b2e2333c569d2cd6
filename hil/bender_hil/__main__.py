"""`python -m bender_hil` does the same as `bender hil`."""

import runpy
import sys

sys.argv.insert(1, "hil")
runpy.run_module("bender_cli", run_name="__main__", alter_sys=True)
