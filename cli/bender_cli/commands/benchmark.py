"""`bender benchmark NAME`: the figures that the documentation quotes, measured afresh."""

import argparse
import importlib
import sys
from collections.abc import Mapping
from pathlib import Path

HELP = "measure the figures that the documentation quotes"
EXAMPLE = """\
bender benchmark tuner
bender benchmark tuner --seeds 5 --methods reliable_bas pattern_search pso
bender benchmark speed --write-docs
bender benchmark identify"""

FIGURES = Path("docs/reference/figures")
BENCHMARKS: Mapping[str, str] = {
    "tuner": "bender_studies.benchmarks.tuner",
    "speed": "bender_studies.benchmarks.speed",
    "benches": "bender_studies.benchmarks.benches",
    "control": "bender_studies.benchmarks.control",
    "discrepancy": "bender_studies.benchmarks.discrepancy",
    "constants": "bender_studies.hidden_effects.constants_benchmark",
    "devices": "bender_studies.benchmarks.devices",
    "diagnose": "bender_studies.benchmarks.diagnose",
    "fleet": "bender_studies.fleet.benchmark",
    "vision": "bender_studies.benchmarks.vision",
    "fuzz": "bender_studies.device_fuzz.benchmark",
    "hil": "bender_studies.benchmarks.hil",
    "identify": "bender_studies.benchmarks.identify",
    "investigate": "bender_studies.benchmarks.investigate",
    "model": "bender_studies.benchmarks.first_model",
    "probabilities": "bender_studies.benchmarks.probabilities",
    "nonlinear": "bender_studies.benchmarks.nonlinear",
    "watch": "bender_studies.watching.benchmark",
}
"""Where each benchmark lives: a module with HELP, `add_arguments` and `run`, like a command."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmarks and the arguments of each."""
    names = parser.add_subparsers(dest="benchmark", required=True, metavar="NAME")
    for name, path in BENCHMARKS.items():
        module = importlib.import_module(path)
        parser = names.add_parser(name, help=module.HELP, description=module.HELP)
        module.add_arguments(parser)
        parser.add_argument("--out", type=Path, metavar="DIR", default=Path(f"results/benchmark-{name}"))
        parser.add_argument(
            "--write-docs",
            nargs="?",
            type=Path,
            const=FIGURES,
            metavar="DIR",
            help=f"put the tables on the page NAME.md (default DIR: {FIGURES})",
        )


def run(arguments: argparse.Namespace) -> int:
    """Run the benchmark that was named, and put its tables on its page where that is asked for."""
    status = importlib.import_module(BENCHMARKS[arguments.benchmark]).run(arguments)
    if arguments.write_docs is not None and status == 0:
        from bender_loop.shell.run import current
        from bender_studies.figures_page import write_figures

        if (run := current()) is not None:
            sys.stdout.write(f"written: {write_figures(run, arguments.benchmark, arguments.write_docs)}\n")
    return status
