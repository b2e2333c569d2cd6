"""`bender hil`: the bench's own command, with the FMUs and the gains files that only the command line knows."""

import argparse
from pathlib import Path

from bender_hil.command import EXAMPLE, HELP, add_arguments

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]


def run(arguments: argparse.Namespace) -> int:
    """Run on a bench; returns the exit status. Raises what `bender_hil.command.run` raises."""
    from bender_hil.command import run as run_bench
    from bender_tuner.results.gains_file import read_bench_gains, read_controller

    return run_bench(
        arguments, fmu=_plant_fmu, read_gains=read_bench_gains, read_model=lambda path: read_controller(path)[3]
    )


def _plant_fmu(model: str) -> Path:
    from bender_native.ready import ready_plant_fmu

    return ready_plant_fmu(model)
