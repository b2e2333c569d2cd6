"""`bender bench check`: the first thing to run on a new bench, with the FMUs that only the command line knows."""

import argparse
from pathlib import Path

from bender_hil.check.command import EXAMPLE

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]

HELP = "check a bench: what is connected, what it answers, what is missing, two dry runs"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the actions and their arguments."""
    from bender_hil.check.command import add_arguments as add_check_arguments

    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    add_check_arguments(actions.add_parser("check", help="look at everything, at 0 V and at the smallest voltage"))


def run(arguments: argparse.Namespace) -> int:
    """Check the bench; returns the exit status. Raises what `bender_hil.check.command.run` raises."""
    from bender_hil.check.command import run as run_check

    return run_check(arguments, fmu=_plant_fmu)


def _plant_fmu(model: str) -> Path:
    from bender_native.ready import ready_plant_fmu

    return ready_plant_fmu(model)
