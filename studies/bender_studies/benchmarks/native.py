"""`bender benchmark native`: FMUs without Python beside those with PythonFMU, in one run."""

import argparse
import sys
from pathlib import Path

HELP = "FMUs without Python: a step in a host in C and through fmpy, a tuning, beside PythonFMU"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how often, and where the results go."""
    parser.add_argument("--repeats", type=int, metavar="N", default=5, help="of every measurement (default: 5)")
    parser.add_argument("--out", type=Path, metavar="DIR", default=Path("results/benchmark-native"))


def run(arguments: argparse.Namespace) -> int:
    """Print the table with its targets, write native.json."""
    from bender_loop.errors import InputError
    from bender_loop.shell.files import prepare_directory, write_result
    from bender_loop.shell.progress import Progress, print_table
    from bender_studies.benchmarks.speed import cells, facts
    from bender_studies.tuning.native_speed import measure_native

    if arguments.repeats < 1:
        raise InputError(f"--repeats: found {arguments.repeats}, expected at least 1")
    with Progress("native benchmark, parts") as progress:
        figures, explanations = measure_native(arguments.repeats, progress.update)
    out: Path = prepare_directory(arguments.out)
    table = {"figures": [facts(figure) for figure in figures], "compared": explanations}
    write_result(out / "native.json", table)
    columns = ("measured", "unit", "best", "median", "target", "met")
    print_table("What an FMU without Python costs", columns, [cells(figure) for figure in figures])
    sys.stdout.writelines(f"{sentence}\n" for sentence in explanations)
    sys.stdout.write(f"written: {out / 'native.json'}\n")
    return 0
