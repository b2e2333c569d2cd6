"""`bender reproduce`: every number, table and figure of the paper beside ours."""

import argparse
import sys
from pathlib import Path

from bender_loop.shell.options import add_results_arguments

HELP = "compute every number, table and figure of the paper, beside ours"
EXAMPLE = "bender reproduce --out results/reproduce"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare where the results go, and the seed."""
    add_results_arguments(parser, Path("results") / "reproduce")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of noise and searches (default: 0)")


def run(arguments: argparse.Namespace) -> int:
    """Reproduce; prints where the page is.

    Raises:
        InputError: the seed is negative, and whatever `reproduce` raises.
        RunError: an exhibit failed; the others are written.
    """
    from bender_loop.errors import InputError, RunError

    if arguments.seed < 0:
        raise InputError(f"--seed: found {arguments.seed}, expected 0 or more")
    from bender_loop.shell.extras import require

    for library in ("pysindy", "matplotlib"):
        require(library, "identify", "bender reproduce")
    from bender_loop.shell.files import results_folder
    from bender_studies.reproduction.run import reproduce

    page, failed = reproduce(results_folder(arguments), arguments.seed)
    sys.stdout.write(f"read on: {page.resolve().as_uri()}\n")
    if failed:
        raise RunError(f"the run of {', '.join(failed)} failed; the page says why, all others are complete")
    return 0
