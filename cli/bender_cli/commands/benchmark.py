"""`bender benchmark NAME`: the figures that the documentation quotes, measured afresh."""

import argparse
import importlib
from collections.abc import Mapping

HELP = "measure the figures that the documentation quotes"
EXAMPLE = """\
bender benchmark tuner
bender benchmark tuner --seeds 5 --methods reliable_bas pattern_search pso
bender benchmark speed
bender benchmark identify"""

BENCHMARKS: Mapping[str, str] = {
    "tuner": "bender_studies.benchmarks.tuner",
    "speed": "bender_studies.benchmarks.speed",
    "native": "bender_studies.benchmarks.native",
    "discrepancy": "bender_studies.benchmarks.discrepancy",
    "constants": "bender_studies.hidden_effects.constants_benchmark",
    "diagnose": "bender_studies.benchmarks.diagnose",
    "fleet": "bender_studies.fleet.benchmark",
    "fuzz": "bender_studies.benchmarks.fuzz",
    "vision": "bender_studies.benchmarks.vision",
    "hil": "bender_studies.benchmarks.hil",
    "identify": "bender_studies.benchmarks.identify",
    "investigate": "bender_studies.benchmarks.investigate",
    "live": "bender_studies.bench_trials.watched_runs",
    "model": "bender_studies.benchmarks.first_model",
    "rigs": "bender_studies.benchmarks.rigs",
}
"""Where each benchmark lives: a module with HELP, `add_arguments` and `run`, like a command."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmarks and the arguments of each."""
    names = parser.add_subparsers(dest="benchmark", required=True, metavar="NAME")
    for name, path in BENCHMARKS.items():
        module = importlib.import_module(path)
        module.add_arguments(names.add_parser(name, help=module.HELP, description=module.HELP))


def run(arguments: argparse.Namespace) -> int:
    """Run the benchmark that was named."""
    return importlib.import_module(BENCHMARKS[arguments.benchmark]).run(arguments)
