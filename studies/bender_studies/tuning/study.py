"""The comparison of the methods: settings, order of the work, result."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from bender_studies.tuning.figures import PlantResult, summarised
from bender_studies.tuning.method_runs import MethodTask, gain_values
from bender_studies.tuning.optimum import FEWEST_EVALUATIONS, agree, global_tasks, polish_tasks
from bender_studies.tuning.plants import PLANTS, BenchmarkPlant, Problem
from bender_studies.tuning.pool import Pool
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
        jobs: processes that work at the same time.
        methods: keys of METHODS.
        plants: the loops.

    Raises:
        ValueError: a number is too small, or there is no such method.
    """

    seeds: int = 30
    evaluations: int = DEFAULT_BUDGET
    optimum_evaluations: int = 20_000
    jobs: int = 1
    methods: tuple[str, ...] = field(default_factory=lambda: tuple(METHODS))
    plants: tuple[BenchmarkPlant, ...] = PLANTS

    def __post_init__(self) -> None:
        for name, least in (
            ("seeds", 1),
            ("evaluations", 1),
            ("optimum_evaluations", FEWEST_EVALUATIONS),
            ("jobs", 1),
        ):
            value = getattr(self, name)
            if value < least:
                raise ValueError(f"{name} must be >= {least}, found {value!r}")
        for name in ("methods", "plants"):
            if not getattr(self, name):
                raise ValueError(f"{name} must name at least one, found none")
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
    """Compare the methods on every plant, one plant after the other.

    Args:
        settings: how much is done.
        fmus: FMU file of each model that the plants name.
        report: told how far the work is.

    Raises:
        InputError: an FMU file is missing or does not fit.
        RunError: an FMU fails, or a process dies.
    """
    total = len(settings.plants) * _planned(settings)
    done = 0
    results: list[PlantResult] = []
    for plant in settings.plants:

        def advance(evaluations: int, name: str = plant.name) -> None:
            nonlocal done
            done += evaluations
            report(min(done, total), total, f"plant {name}")

        with Pool(plant, fmus[plant.model], settings.jobs, advance) as pool:
            results.append(_on_plant(settings, plant, pool))
    return results


def _on_plant(settings: StudySettings, plant: BenchmarkPlant, pool: Pool) -> PlantResult:
    """The long searches go first, the runs fill the gaps, the polishing comes last."""
    searches = global_tasks(settings.optimum_evaluations)
    # Seed by seed, so that whatever else the machine does falls on all methods alike.
    runs = [
        MethodTask(method, seed, settings.evaluations) for seed in range(settings.seeds) for method in settings.methods
    ]
    guess = [GuessTask()]
    submitted = pool.submit(searches), pool.submit(guess), pool.submit(runs)
    ends = pool.results(searches, submitted[0])
    polishes = polish_tasks(ends, settings.optimum_evaluations)
    polished = pool.submit(polishes)
    ((gains, guess_um2),) = pool.results(guess, submitted[1])
    found = pool.results(runs, submitted[2])
    ends += pool.results(polishes, polished)
    optimum = agree(ends, sum(task.weight for task in [*searches, *polishes]))
    return summarised(plant, gains, guess_um2, optimum, found)


def _planned(settings: StudySettings) -> int:
    return len(settings.methods) * settings.seeds * settings.evaluations + settings.optimum_evaluations
