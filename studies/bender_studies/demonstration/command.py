"""`bender demo`: the main job, end to end, on what the repository ships."""

import argparse
import sys
from pathlib import Path

from bender_loop.shell.options import add_results_arguments

HELP = "show the whole run on the emulated bench: build, tune, diagnose, tune again, report"
EXAMPLE = "bender demo --out results/demo"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare where the results go."""
    add_results_arguments(parser, Path("results") / "demo")


def run(arguments: argparse.Namespace) -> int:
    """Run the demonstration; prints where its page is."""
    from bender_loop.shell.extras import require
    from bender_loop.shell.files import results_folder
    from bender_loop.shell.run import answer
    from bender_report.drawing import require_drawing
    from bender_studies.demonstration.run import demonstrate

    require_drawing("bender demo")
    require("cv2", "bench", "bender demo")
    page = demonstrate(results_folder(arguments))
    answer({"page": str(page), "written": str(arguments.out)})
    sys.stdout.write(f"read on: {page.resolve().as_uri()}\n")
    return 0
