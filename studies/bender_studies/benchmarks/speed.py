"""`bender benchmark speed`: what an evaluation costs, held against the bare FMU, and what a start costs."""

import argparse

HELP = "a loop step over the bare FMU calls, a tuning, the command line's start"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how often, and where the results go."""
    parser.add_argument(
        "--repeats", type=int, metavar="N", help="of every measurement (default: as many as each one needs)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the table with its targets, write speed.json."""
    from dataclasses import asdict

    from bender_export.build import ensure_plant_fmu
    from bender_loop.shell.files import prepare_directory
    from bender_loop.shell.progress import print_table
    from bender_studies.runner import check_least, collected, write_facts
    from bender_studies.tuning.speed import PLANT, measure_speed

    check_least(arguments, 1, "repeats")
    out = prepare_directory(arguments.out)
    measured = measure_speed(ensure_plant_fmu(PLANT.model), arguments.repeats)
    figures, status = collected(measured, "speed benchmark, figures", lambda x: x.what)
    met = {None: None, True: "yes", False: "NO"}
    rows = [[x.what, x.unit, x.best, x.median, x.at_most, met[x.met]] for x in figures]
    print_table("What an evaluation costs", ("measured", "unit", "best", "median", "at most", "met"), rows)
    write_facts(out / "speed.json", {"figures": [asdict(x) | {"met": x.met} for x in figures]})
    return status
