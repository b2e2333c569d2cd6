"""From runs to the figures of a table, and from the figures to plain sentences."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from bender_studies.tuning.method_runs import MethodRun
from bender_studies.tuning.optimum import Optimum
from bender_studies.tuning.plants import BenchmarkPlant
from bender_tuner.optimisers import METHODS

DEFAULT_METHOD = "reliable_bas"
BEETLES = ("bas_printed", "bas", "reliable_bas")
LEVEL, LEVEL_WORST = 1.001, 1.01
"""Methods are called level where their medians and their worst runs lie within these factors of each other."""


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
    """What is promised of the beetle and of the default method, judged on the worse plant."""
    promises = (("the reliable beetle (reliable_bas)", "reliable_bas", 1.05, 1.5),)
    promises += ((f"the default method ({DEFAULT_METHOD})", DEFAULT_METHOD, 1.01, 1.05),)
    found: list[Target] = []
    for title, method, median_bound, worst_bound in promises:
        rows = [row for result in results for row in result.figures if row.method == method]
        if rows:
            found.append(Target(f"{title}: median", median_bound, max(row.median_ratio for row in rows)))
            found.append(Target(f"{title}: worst", worst_bound, max(row.worst_ratio for row in rows)))
    return found


def sentences(result: PlantResult) -> list[str]:
    """Say of one plant which methods are best, where the beetles stand, and how sure the optimum is."""
    name, rows, optimum = result.plant.name, result.figures, result.optimum
    scores = {row.method: (row.median_ratio, row.worst_ratio) for row in rows}
    best = level_with_best(scores)
    places = {row.method: place for place, row in enumerate(rows, 1)}
    said = [
        _best(name, best, scores),
        *(
            f"{name}: {beetle} takes place {places[beetle]} of {len(rows)} ({_written(scores[beetle])})."
            for beetle in BEETLES
            if beetle in scores and beetle not in best
        ),
        f"{name}: the optimum is {optimum.best_um2:.6g} µm² from {optimum.evaluations} evaluations; "
        f"{optimum.agreeing} of {optimum.polishes} polishing searches end within 0.1 % of the best of their box.",
    ]
    box_um2 = min(optimum.box_um2, *(run.best_um2 for run in result.runs if METHODS[run.method].space == "box"))
    if box_um2 > LEVEL * result.reference_um2:
        said.append(
            f"{name}: the optimum lies outside the box that the methods search, whose own is {box_um2:.6g} µm²: "
            f"{ratio(box_um2 / result.reference_um2)} is the best ratio to be had there."
        )
    if result.reference_um2 < optimum.best_um2 * (1.0 - 1e-6):
        finder = min(result.runs, key=lambda run: run.best_um2)
        said.append(
            f"{name}: {finder.method} found {result.reference_um2:.6g} µm², less than the search for the optimum; "
            "the ratios refer to that."
        )
    return said


def overall(results: Sequence[PlantResult]) -> list[str]:
    """Which methods are best over all plants, each by its worse plant, and whether a beetle is among them."""
    names = [row.method for row in results[0].figures]
    rows = {name: [row for result in results for row in result.figures if row.method == name] for name in names}
    scores = {
        name: (max(row.median_ratio for row in found), max(row.worst_ratio for row in found))
        for name, found in rows.items()
    }
    best = level_with_best(scores)
    said = [_best("All plants", best, scores)]
    tried = [name for name in BEETLES if name in names]
    kept = [name for name in tried if name in best]
    if tried:
        verdict = f"Yes: {', '.join(kept)}" if kept else "No"
        said.append(f"Is beetle antennae search the best, or level with the best? {verdict}.")
        said += [f"{name} is not ({_written(scores[name])})." for name in tried if name not in kept]
    return said


def level_with_best(scores: Mapping[str, tuple[float, float]]) -> list[str]:
    """The methods that no other beats, the best one first.

    The best has the smallest median ratio, then the smallest worst one; level with it is what comes within 0.1 % of
    its median and within 1 % of its worst.

    Args:
        scores: median and worst ratio of each method.
    """
    order = sorted(scores, key=lambda name: scores[name])
    median_ratio, worst_ratio = scores[order[0]]
    return [
        name
        for name in order
        if scores[name][0] <= LEVEL * median_ratio and scores[name][1] <= LEVEL_WORST * worst_ratio
    ]


def _best(where: str, best: Sequence[str], scores: Mapping[str, tuple[float, float]]) -> str:
    if len(best) == 1:
        return f"{where}: the best method is {best[0]} ({_written(scores[best[0]])})."
    listed = ", ".join(f"{name} ({_written(scores[name])})" for name in best)
    return f"{where}: the best methods, level with each other, are {listed}."


def _written(score: tuple[float, float]) -> str:
    return f"median {ratio(score[0])}, worst {ratio(score[1])}"


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
