"""`python -m bender_tuner` does the same as `bender tune`."""

import runpy
import sys

sys.argv.insert(1, "tune")
runpy.run_module("bender_cli", run_name="__main__", alter_sys=True)
