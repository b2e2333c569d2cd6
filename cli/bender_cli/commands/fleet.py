"""`bender fleet`: many units on a Dask cluster; and records of a fleet to try it on."""

import argparse
import sys
from pathlib import Path

from bender_fleet.command import EXAMPLE, HELP
from bender_fleet.command import add_arguments as add_fleet_arguments

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the actions and their arguments."""
    example = add_fleet_arguments(parser).add_parser("example", help="write records of a fleet that hides effects")
    example.add_argument("--units", type=int, default=200, metavar="N", help="how many units (default: 200)")
    example.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the records (default: 0)")
    example.add_argument("--seconds", type=float, default=40.0, metavar="S", help="length of each record (default: 40)")
    example.add_argument(
        "--out", type=Path, default=Path("results/fleet-example"), metavar="DIR", help="default: results/fleet-example"
    )


def run(arguments: argparse.Namespace) -> int:
    """Do the action; InputError for bad usage, sources and directories, with nothing written."""
    if arguments.action != "example":
        from bender_fleet.command import run as run_action

        return run_action(arguments)
    from bender_loop.shell.progress import Progress
    from bender_proving.fleet import FleetSettings, write_fleet

    with Progress("fleet example") as bar:
        settings = FleetSettings(arguments.units, arguments.seed, arguments.seconds)
        sys.stdout.write(f"{write_fleet(settings, arguments.out, bar.update)}\n")
    return 0
