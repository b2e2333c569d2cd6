"""`bender benchmark tuner`: every method on two plants, against the optimum."""

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bender_studies.tuning.figures import MethodFigures, PlantResult
    from bender_studies.tuning.study import StudySettings

HELP = "the methods of `bender tune` on two plants, many seeds each, against the optimum"
COLUMNS = ("method", "median_um2", "worst_um2", "median_ratio", "worst_ratio", "within_1.05", "within_1.1", "cpu_s")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how much is run, and where the results go."""
    parser.add_argument("--seeds", type=int, default=30, metavar="N", help="runs of every method (default: 30)")
    parser.add_argument("--evaluations", type=int, default=151, metavar="N", help="of each run (default: 151)")
    parser.add_argument(
        "--optimum-evaluations", type=int, default=20_000, metavar="N", help="for each optimum (default: 20000)"
    )
    parser.add_argument("--methods", nargs="+", metavar="METHOD", help="default: all methods")
    parser.add_argument("--plants", nargs="+", metavar="PLANT", help="T1, T2 or both (default)")
    parser.add_argument("--jobs", type=int, metavar="N", help="parallel processes (default: one per processor)")


def run(arguments: argparse.Namespace) -> int:
    """Print the tables, write tuner.json."""
    from dataclasses import asdict

    from bender_export.build import ensure_plant_fmu
    from bender_loop.shell.files import prepare_directory
    from bender_loop.shell.progress import Progress, print_table
    from bender_studies.runner import write_facts
    from bender_studies.tuning.figures import ratio, targets
    from bender_studies.tuning.study import run_study

    settings = _settings(arguments)
    prepare_directory(arguments.out)
    # Before any is loaded: PythonFMU's own modules inside a loaded FMU stand in the way of building another.
    fmus = {plant.model: ensure_plant_fmu(plant.model) for plant in settings.plants}
    with Progress("tuner benchmark, evaluations") as progress:
        results = run_study(settings, fmus, progress.update)
    for result in results:
        print_table(heading(result), COLUMNS, [_cells(row) for row in result.figures])
    promised = targets(results)
    if promised:
        rows = [[x.what, f"<= {x.bound:g}", ratio(x.found), "yes" if x.met else "NO"] for x in promised]
        print_table("Targets, on the worse plant", ("target", "bound", "found", "met"), rows)
    facts = {"seeds": settings.seeds, "evaluations": settings.evaluations, "plants": [asdict(x) for x in results]}
    write_facts(arguments.out / "tuner.json", facts | {"targets": [asdict(x) | {"met": x.met} for x in promised]})
    return 0


def _settings(arguments: argparse.Namespace) -> "StudySettings":
    from bender_loop.errors import InputError
    from bender_studies.runner import check_known
    from bender_studies.tuning.plants import PLANTS
    from bender_studies.tuning.study import StudySettings
    from bender_tuner.optimisers import METHODS

    known = {plant.name: plant for plant in PLANTS}
    wanted: list[str] = list(dict.fromkeys(arguments.plants or known))
    check_known("--plants", wanted, known)
    try:
        return StudySettings(
            seeds=arguments.seeds,
            evaluations=arguments.evaluations,
            optimum_evaluations=arguments.optimum_evaluations,
            jobs=arguments.jobs,
            methods=tuple(dict.fromkeys(arguments.methods or METHODS)),
            plants=tuple(known[name] for name in wanted),
        )
    except ValueError as error:
        raise InputError(f"bender benchmark tuner: {error}") from None


def heading(result: "PlantResult") -> str:
    """Title of a plant's table: its optimum, how sure that is, and what the box of the methods holds at best."""
    plant, optimum = result.plant, result.optimum
    return (
        f"{plant.name}: {plant.title}; optimum {result.reference_um2:.5g} µm² ({optimum.evaluations} evaluations, "
        f"{optimum.agreeing} of {optimum.polishes} searches agree; in the box of the methods {optimum.box_um2:.5g}), "
        f"SIMC first guess {result.guess_um2:.4g}"
    )


def _cells(row: "MethodFigures") -> list[str]:
    from bender_studies.tuning.figures import ratio

    values = [f"{row.median_um2:.4g}", f"{row.worst_um2:.4g}", ratio(row.median_ratio), ratio(row.worst_ratio)]
    shares = [f"{share:.0%}" for share in (row.within_5_percent, row.within_10_percent)]
    return [row.method, *values, *shares, f"{row.median_cpu_s:.2f}"]
