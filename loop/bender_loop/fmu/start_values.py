"""Values of an FMU's parameters by `--set NAME=VALUE`, the same in every command that takes an FMU."""

import argparse
import math

from bender_loop.errors import InputError


def add_set_argument(parser: argparse.ArgumentParser) -> None:
    """Declare `--set`."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="start_values",
        metavar="NAME=VALUE",
        help="a parameter of the FMU, or a further input held constant (fan_W=4), in its own unit; may be given "
        "several times",
    )


def start_values(arguments: argparse.Namespace) -> dict[str, float]:
    """Return the values that were set, by name.

    Raises:
        InputError: one is no NAME=VALUE with a finite number, or a name is set twice.
    """
    found: dict[str, float] = {}
    for word in arguments.start_values:
        name, _, text = str(word).rpartition("=")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not name or not math.isfinite(value):
            raise InputError(f"--set: found {word!r}, expected NAME=VALUE with a finite number")
        if name in found:
            raise InputError(f"--set: found {name} twice, expected each parameter once")
        found[name] = value
    return found
