"""`bender benchmark tuner`: every method on two plants, against the optimum."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bender_studies.tuning.figures import PlantResult
    from bender_studies.tuning.study import StudySettings

HELP = "the methods of `bender tune` on two plants, many seeds each, against the optimum"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how much is run, and where the results go."""
    parser.add_argument("--seeds", type=int, default=30, metavar="N", help="runs of every method (default: 30)")
    parser.add_argument(
        "--evaluations", type=int, default=151, metavar="N", help="evaluations of each run (default: 151)"
    )
    parser.add_argument(
        "--optimum-evaluations",
        type=int,
        default=20_000,
        metavar="N",
        help="evaluations of the search for each optimum (default: 20000)",
    )
    parser.add_argument("--methods", nargs="+", metavar="METHOD", help="default: all methods")
    parser.add_argument("--plants", nargs="+", metavar="PLANT", help="T1, T2 or both (default)")
    parser.add_argument("--jobs", type=int, metavar="N", help="parallel processes (default: one per processor)")


def run(arguments: argparse.Namespace) -> int:
    """Print the tables and the verdict, write tuner.json."""
    from bender_export.build import ensure_plant_fmu
    from bender_loop.shell.files import prepare_directory
    from bender_loop.shell.progress import Progress
    from bender_studies.tuning.study import run_study

    settings = _settings(arguments)
    prepare_directory(arguments.out)
    # Before any is loaded: PythonFMU's own modules inside a loaded FMU stand in the way of building another.
    fmus = {plant.model: ensure_plant_fmu(plant.model) for plant in settings.plants}
    with Progress("tuner benchmark, evaluations") as progress:
        results = run_study(settings, fmus, progress.update)
    _write(arguments.out, settings, results)
    _print(arguments.out, results)
    return 0


def _settings(arguments: argparse.Namespace) -> "StudySettings":
    import os

    from bender_loop.errors import InputError
    from bender_studies.tuning.plants import PLANTS
    from bender_studies.tuning.study import StudySettings
    from bender_tuner.optimisers import METHODS

    known = {plant.name: plant for plant in PLANTS}
    wanted: list[str] = list(dict.fromkeys(arguments.plants or known))
    for name in wanted:
        if name not in known:
            raise InputError(f"--plants: found {name!r}, expected one of {', '.join(known)}")
    try:
        return StudySettings(
            seeds=arguments.seeds,
            evaluations=arguments.evaluations,
            optimum_evaluations=arguments.optimum_evaluations,
            jobs=(os.cpu_count() or 1) if arguments.jobs is None else arguments.jobs,
            methods=tuple(dict.fromkeys(arguments.methods or METHODS)),
            plants=tuple(known[name] for name in wanted),
        )
    except ValueError as error:
        raise InputError(f"bender benchmark tuner: {error}") from None


def _write(out: Path, settings: "StudySettings", results: "Sequence[PlantResult]") -> None:
    from bender_loop.shell.files import write_atomically
    from bender_studies.tuning.outputs import to_json

    write_atomically(out / "tuner.json", to_json(settings, results))


def _print(out: Path, results: "Sequence[PlantResult]") -> None:
    from bender_loop.shell.progress import print_table
    from bender_studies.tuning.figures import targets
    from bender_studies.tuning.outputs import COLUMNS, TARGET_COLUMNS, cells, heading, target_cells, verdict

    for result in results:
        print_table(heading(result), COLUMNS, [cells(row) for row in result.figures])
        sys.stdout.write("\n")
    promised = target_cells(targets(results))
    if promised:
        print_table("Targets, on the worse plant", TARGET_COLUMNS, promised)
        sys.stdout.write("\n")
    sys.stdout.writelines(f"{sentence}\n" for sentence in verdict(results))
    sys.stdout.write(f"written: {out / 'tuner.json'}\n")
