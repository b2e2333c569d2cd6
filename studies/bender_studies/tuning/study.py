"""The comparison of the methods on one plant after the other: settings, order of the work, result."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from bender_studies.runner import workers
from bender_studies.tuning.figures import PlantResult, summarised
from bender_studies.tuning.method_runs import MethodTask, gain_values
from bender_studies.tuning.optimum import FEWEST_EVALUATIONS, agree, global_tasks, polish_tasks
from bender_studies.tuning.plants import PLANTS, BenchmarkPlant, Problem
from bender_tuner.optimisers import DEFAULT_BUDGET, METHODS

Report = Callable[[int, int, str], None]
"""Takes evaluations done, evaluations in all, and what is going on."""


@dataclass(frozen=True, slots=True)
class StudySettings:
    """How much is done.

    Attributes:
        seeds: runs of every method, with the seeds 0, 1, ...
        evaluations: of a run.
        optimum_evaluations: of the search for the optimum, at least.
        jobs: processes that work at the same time; None for one per processor.
        methods: keys of METHODS.
        plants: the loops.
    """

    seeds: int = 30
    evaluations: int = DEFAULT_BUDGET
    optimum_evaluations: int = 20_000
    jobs: int | None = None
    methods: tuple[str, ...] = field(default_factory=lambda: tuple(METHODS))
    plants: tuple[BenchmarkPlant, ...] = PLANTS

    def __post_init__(self) -> None:
        least = {"seeds": 1, "evaluations": 1, "optimum_evaluations": FEWEST_EVALUATIONS, "jobs": 1}
        for name, bound in least.items():
            value = getattr(self, name)
            if value is not None and value < bound:
                raise ValueError(f"{name} must be >= {bound}, found {value!r}")
        for method in self.methods:
            if method not in METHODS:
                raise ValueError(f"methods must be among {', '.join(METHODS)}, found {method!r}")


@dataclass(frozen=True, slots=True)
class GuessTask:
    """The first guess and its MSE."""

    weight: int = 1

    def __call__(self, problem: Problem) -> tuple[tuple[float, float, float], float]:
        """Kp, Ki, Kd and um^2."""
        box = problem.box()
        centre = box.from_gains(problem.guess)
        return gain_values(box, centre), problem.value(box, centre)


def run_study(settings: StudySettings, fmus: Mapping[str, Path], report: Report) -> list[PlantResult]:
    """Compare the methods on every plant; `fmus` has the FMU of each model that the plants name."""
    runs = len(settings.methods) * settings.seeds * settings.evaluations
    total = len(settings.plants) * (runs + settings.optimum_evaluations)
    done = 0
    results: list[PlantResult] = []
    for plant in settings.plants:

        def advance(evaluations: int, name: str = plant.name) -> None:
            nonlocal done
            done += evaluations
            report(min(done, total), total, f"plant {name}")

        results.append(_on_plant(settings, plant, fmus[plant.model], advance))
    return results


def _on_plant(settings: StudySettings, plant: BenchmarkPlant, fmu: Path, advance: Callable[[int], None]) -> PlantResult:
    """Searches, runs and polishing, in processes of the plant's own: two FMUs never meet in one interpreter."""
    searches = global_tasks(settings.optimum_evaluations)
    # Seed by seed, so that whatever else the machine does falls on all methods alike.
    runs = [
        MethodTask(method, seed, settings.evaluations) for seed in range(settings.seeds) for method in settings.methods
    ]
    with workers(settings.jobs) as pool:

        def results_of(tasks: Sequence[Any]) -> Iterator[Any]:
            waiting = [pool.submit(_do, plant, fmu, task) for task in tasks]
            for task, one in zip(tasks, waiting, strict=True):
                yield one.result()
                advance(task.weight)

        *found, (gains, guess_um2) = results_of([*searches, *runs, GuessTask()])
        ends, found = found[: len(searches)], found[len(searches) :]
        polishes = polish_tasks(ends, settings.optimum_evaluations)
        ends += results_of(polishes)
    optimum = agree(ends, sum(task.weight for task in [*searches, *polishes]))
    return summarised(plant, gains, guess_um2, optimum, found)


def _do(plant: BenchmarkPlant, fmu: Path, task: Callable[[Problem], Any]) -> Any:
    return task(_problem(plant, fmu))


@cache
def _problem(plant: BenchmarkPlant, fmu: Path) -> Problem:
    return Problem(plant, fmu)
