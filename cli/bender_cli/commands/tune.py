"""`bender tune`: the tuner's own command, and the model that it tunes where no FMU is named."""

import argparse
from pathlib import Path

from bender_tuner.command import EXAMPLE, HELP
from bender_tuner.command import add_arguments as add_tuner_arguments

__all__ = ["EXAMPLE", "HELP", "add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the tuner's arguments and the model."""
    add_tuner_arguments(parser)
    parser.add_argument(
        "--model", help="model file or built-in model: paper, beam, bench (default: paper, one particular device)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Tune; returns the exit status.

    Raises:
        InputError: both an FMU and a model are named, and whatever `bender_tuner.command.run` raises.
    """
    from bender_loop.errors import InputError
    from bender_tuner.command import run as run_tuner

    if arguments.fmu is not None and arguments.model is not None:
        raise InputError("--fmu and --model both name a plant; give only one")
    return run_tuner(arguments, "paper" if arguments.model is None else arguments.model, _plant_fmu, _lacking_fmus)


def _plant_fmu(model: str | Path) -> Path:
    from bender_native.ready import ready_plant_fmu

    return ready_plant_fmu(model)


def _lacking_fmus(model: str | Path) -> tuple[tuple[str, Path], ...]:
    from bender_native.lacking import lacking_fmus

    return lacking_fmus(model)
