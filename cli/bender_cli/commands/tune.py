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
    if arguments.model is not None:
        _fit_to_device(arguments)
    return run_tuner(arguments, "paper" if arguments.model is None else arguments.model, _plant_fmu, _lacking_fmus)


def _fit_to_device(arguments: argparse.Namespace) -> None:
    """Take the range of commands of a model of another device, and say what is taken for it that nobody gave."""
    from bender_effects.rigs import is_piezo_bender, learned_commands
    from bender_inference.records.checks import read_model
    from bender_loop.shell.run import remark_held
    from bender_tuner.command import DEFAULT_LIMITS_V

    model = read_model(arguments.model)
    if is_piezo_bender(model):
        return
    if arguments.voltage_limits is None:
        learned = learned_commands(model)
        low, high = arguments.voltage_limits = learned or DEFAULT_LIMITS_V
        why = f"which {arguments.model} was learned from" if learned else f"as {arguments.model} does not say"
        remark_held(f"commands from {low:g} to {high:g} {(model.units or ('V',))[0]}, {why}: --voltage-limits LOW HIGH")
    if arguments.rate is None:
        remark_held("the loop is seen as by a camera, 30 times a second: --rate, --latency and --exposure say yours")


def _plant_fmu(model: str | Path) -> Path:
    from bender_native.ready import ready_plant_fmu

    return ready_plant_fmu(model)


def _lacking_fmus(model: str | Path) -> tuple[tuple[str, Path], ...]:
    from bender_native.lacking import lacking_fmus

    return lacking_fmus(model)
