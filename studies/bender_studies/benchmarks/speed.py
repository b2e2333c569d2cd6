"""`bender benchmark speed`: what an evaluation costs, held against the bare FMU and against simulate_fmu."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bender_studies.tuning.speed import Figure

HELP = "a loop step over the bare FMU calls, a tuning, the same by simulate_fmu, the command line's start"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how often, and where the results go."""
    parser.add_argument(
        "--repeats", type=int, metavar="N", help="of every measurement (default: as many as each one needs)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the table with its targets, write speed.json."""
    from bender_export.build import ensure_plant_fmu
    from bender_loop.errors import InputError
    from bender_loop.shell.files import prepare_directory, write_result
    from bender_loop.shell.progress import Progress, print_table
    from bender_studies.tuning.speed import PLANT, SpeedSettings, measure_speed, scaled

    settings = SpeedSettings()
    try:
        settings = settings if arguments.repeats is None else scaled(settings, arguments.repeats)
    except ValueError as error:
        raise InputError(f"--repeats: {error}") from None
    out: Path = prepare_directory(arguments.out)
    fmu = ensure_plant_fmu(PLANT.model)
    help_command = [sys.executable, "-P", "-m", "bender_cli", "--help"]
    with Progress("speed benchmark, parts") as progress:
        figures, explanations = measure_speed(fmu, help_command, settings, progress.update)
    table = {"figures": [facts(figure) for figure in figures], "compared": explanations}
    write_result(out / "speed.json", table)
    columns = ("measured", "unit", "best", "median", "target", "met")
    print_table("What an evaluation costs", columns, [cells(figure) for figure in figures])
    sys.stdout.writelines(f"{sentence}\n" for sentence in explanations)
    sys.stdout.write(f"written: {out / 'speed.json'}\n")
    return 0


def facts(figure: "Figure") -> dict[str, object]:
    """Return a figure for JSON."""
    from dataclasses import asdict

    return {**asdict(figure), "met": figure.met}


def cells(figure: "Figure") -> list[str | float | None]:
    """Return a figure's row of the table."""
    met = {None: None, True: "yes", False: "NO"}[figure.met]
    return [figure.what, figure.unit, figure.best, figure.median, figure.target, met]
