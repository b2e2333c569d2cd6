"""From runs to the figures of a table."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from bender_studies.tuning.method_runs import MethodRun
from bender_studies.tuning.optimum import Optimum
from bender_studies.tuning.plants import BenchmarkPlant

DEFAULT_METHOD = "reliable_bas"


@dataclass(frozen=True, slots=True)
class MethodFigures:
    """One row of the table.

    Attributes:
        method: key of METHODS.
        median_um2: of the best MSE over the seeds.
        worst_um2: of the same.
        median_ratio: to the optimum.
        worst_ratio: to the optimum.
        within_5_percent: share of the runs that end within 1.05 of the optimum.
        within_10_percent: share within 1.1.
        median_cpu_s: processor time of a run.
    """

    method: str
    median_um2: float
    worst_um2: float
    median_ratio: float
    worst_ratio: float
    within_5_percent: float
    within_10_percent: float
    median_cpu_s: float


@dataclass(frozen=True, slots=True)
class PlantResult:
    """Everything found on one plant.

    Attributes:
        plant: which loop.
        guess: Kp, Ki, Kd of the SIMC first guess.
        guess_um2: its MSE.
        optimum: of the searches, which saw nothing of the methods.
        reference_um2: what the ratios refer to: the optimum, or a method's best where that is smaller.
        figures: one row per method, the best first.
        runs: of all methods and seeds.
    """

    plant: BenchmarkPlant
    guess: tuple[float, float, float]
    guess_um2: float
    optimum: Optimum
    reference_um2: float
    figures: tuple[MethodFigures, ...]
    runs: tuple[MethodRun, ...]


@dataclass(frozen=True, slots=True)
class Target:
    """A promise about a ratio, and what was found on the worse plant."""

    what: str
    bound: float
    found: float

    @property
    def met(self) -> bool:
        """Whether the figure keeps within the bound."""
        return self.found <= self.bound


def summarised(
    plant: BenchmarkPlant,
    guess: tuple[float, float, float],
    guess_um2: float,
    optimum: Optimum,
    runs: Sequence[MethodRun],
) -> PlantResult:
    """Put the figures of all methods on one plant together."""
    reference = min(optimum.best_um2, *(run.best_um2 for run in runs))
    names = dict.fromkeys(run.method for run in runs)
    rows = [_figures(name, [run for run in runs if run.method == name], reference) for name in names]
    rows.sort(key=lambda row: (row.median_ratio, row.worst_ratio))
    return PlantResult(plant, guess, guess_um2, optimum, reference, tuple(rows), tuple(runs))


def targets(results: Sequence[PlantResult]) -> list[Target]:
    """Return what was promised of two methods beside what was found, on the plant where each did worse."""
    promises = (("the reliable beetle (reliable_bas)", "reliable_bas", 1.05, 1.5),)
    promises += ((f"the default method ({DEFAULT_METHOD})", DEFAULT_METHOD, 1.01, 1.05),)
    found: list[Target] = []
    for title, method, median_bound, worst_bound in promises:
        rows = [row for result in results for row in result.figures if row.method == method]
        if rows:
            found.append(Target(f"{title}: median", median_bound, max(row.median_ratio for row in rows)))
            found.append(Target(f"{title}: worst", worst_bound, max(row.worst_ratio for row in rows)))
    return found


def ratio(value: float) -> str:
    """Write a ratio with four decimals near one, three digits far away."""
    return f"{value:.4f}" if value < 2.0 else f"{value:.3g}"


def _figures(method: str, runs: Sequence[MethodRun], reference: float) -> MethodFigures:
    values = [run.best_um2 for run in runs]
    ratios = [value / reference for value in values]
    return MethodFigures(
        method,
        median(values),
        max(values),
        median(ratios),
        max(ratios),
        sum(ratio <= 1.05 for ratio in ratios) / len(ratios),
        sum(ratio <= 1.1 for ratio in ratios) / len(ratios),
        median(run.cpu_s for run in runs),
    )
