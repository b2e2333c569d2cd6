"""The comparison of the methods as JSON, and written out."""

from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from bender_loop.shell.files import finite, result_text
from bender_studies.tuning.figures import MethodFigures, PlantResult, Target, overall, ratio, sentences, targets
from bender_studies.tuning.study import StudySettings
from bender_tuner.optimisers import METHODS

COLUMNS = ("method", "median_um2", "worst_um2", "median_ratio", "worst_ratio", "within_1.05", "within_1.1", "cpu_s")
TARGET_COLUMNS = ("target", "bound", "found", "met")
_LIBRARIES = ("numpy", "scipy", "fmpy")


def to_json(settings: StudySettings, results: Sequence[PlantResult]) -> str:
    """Everything: settings, figures and every single run. A value that is not finite is null."""
    table: dict[str, Any] = {
        "objective": "mean squared error, equation (28), µm²",
        "seeds": settings.seeds,
        "evaluations": settings.evaluations,
        "jobs": settings.jobs,
        "libraries": {name: _version(name) for name in _LIBRARIES},
        "methods": {
            name: {"library": METHODS[name].library, "space": METHODS[name].space} for name in settings.methods
        },
        "plants": [asdict(result) for result in results],
        "targets": [{**asdict(target), "met": target.met} for target in targets(results)],
        "verdict": verdict(results),
    }
    return result_text(finite(table))


def heading(result: PlantResult) -> str:
    """Title of a plant's table, with its optimum."""
    plant = result.plant
    return (
        f"{plant.name}: {plant.title}; optimum {result.reference_um2:.5g} µm², SIMC first guess {result.guess_um2:.4g}"
    )


def cells(row: MethodFigures) -> list[str]:
    """One row of the table, written out."""
    values = [f"{row.median_um2:.4g}", f"{row.worst_um2:.4g}", ratio(row.median_ratio), ratio(row.worst_ratio)]
    shares = [f"{share:.0%}" for share in (row.within_5_percent, row.within_10_percent)]
    return [row.method, *values, *shares, f"{row.median_cpu_s:.2f}"]


def target_cells(found: Sequence[Target]) -> list[list[str]]:
    """The table of targets, written out."""
    return [[t.what, f"<= {t.bound:g}", ratio(t.found), "yes" if t.met else "NO"] for t in found]


def verdict(results: Sequence[PlantResult]) -> list[str]:
    """All sentences: plant by plant, then over all."""
    return [*(sentence for result in results for sentence in sentences(result)), *overall(results)]


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
