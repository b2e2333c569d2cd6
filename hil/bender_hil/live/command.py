"""`bender live RUN`: a past run, or an investigation, on the page on which runs are watched."""

import argparse
import sys
import time
from pathlib import Path

from bender_loop.errors import InputError

HELP = "replay a past run or an investigation on the page on which runs are watched"
EXAMPLE = """\
bender live results/monday                        # open the address that is printed
bender live results/investigate-20260101-090000   # the newest run of an investigation"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the run."""
    parser.add_argument("run_directory", type=Path, metavar="RUN", help="directory of a run or an investigation")


def run(arguments: argparse.Namespace) -> int:
    """Serve the page until an interrupt; returns 0.

    Raises:
        InputError: there is no run in the directory, or NiceGUI is not installed.
    """
    from bender_hil.live.run_view import newest_run
    from bender_hil.live.session import LiveSession

    if newest_run(arguments.run_directory) is None:
        raise InputError(f"{arguments.run_directory}: found no run.jsonl, expected the directory of a run")
    with LiveSession(arguments.run_directory, is_replay=True) as session:
        sys.stdout.write(f"replay: {session.url}\nCtrl-C ends it\n")
        sys.stdout.flush()
        try:
            while True:
                time.sleep(1.0)
        except KeyboardInterrupt:
            return 0
