"""The beetle on the paper's own task: as printed, with the sign of (25) turned, on nothing but noise, and ours.

The task: a step of 10 um on equation (30) with the beam's first mode, 100 Hz, 2 s, the mean squared error (28).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bender_loop.control.metrics import StepMetrics
from bender_loop.control.pid import Gains
from bender_loop.control.trace import Trace
from bender_loop.errors import RunError
from bender_tuner.optimisers import create
from bender_tuner.task.experiment import StepExperiment
from bender_tuner.task.objectives import Objective, at_point
from bender_tuner.task.problem import TuningProblem, pose_problem
from bender_tuner.task.search_space import DIMENSION, RawSpace
from bender_tuner.task.session import open_guarded
from bender_tuner.task.settings import make_settings
from bender_tuner.task.tuning import Ended, run_search

Array = NDArray[np.float64]
Report = Callable[[int, int | None, str], None]

KINDS = ("printed", "turned", "noise", "ours")
JUDGED_S = 6.0
"""Length of the runs that gains are judged by: a settling time of 3.82 s cannot be seen in 2 s."""
PROBES = 3
STILL = 0.2
"""A gain stands still when it stays within this part of its whole travel from where it ends."""


@dataclass(frozen=True, slots=True, eq=False)
class Beetle:
    """One search.

    Attributes:
        places: gains Kp, Ki, Kd at the start and after every iteration, (iterations + 1, 3).
        gains: the best that the method keeps; None where none holds.
        mse_um2: the value there, inf without gains.
        trace: the step with these gains, None without.
        metrics: its figures, None without.
    """

    places: Array
    gains: Gains | None
    mse_um2: float
    trace: Trace | None = None
    metrics: StepMetrics | None = None

    @property
    def still_after(self) -> int:
        """The iteration from which on all three gains stand still."""
        away = np.abs(self.places - self.places[-1]) > STILL * np.ptp(self.places, axis=0)
        moving = np.flatnonzero(away.any(axis=1))
        return int(moving[-1]) + 1 if moving.size else 0


@dataclass(frozen=True, slots=True, eq=False)
class Beetles:
    """All searches by their kind, one for each seed, and the loop that they were run on."""

    runs: dict[str, tuple[Beetle, ...]]

    def median(self, kind: str, figure: Callable[[StepMetrics], float]) -> float:
        """Median over the seeds of a figure of the step response; what is never reached counts as inf."""
        values = [math.inf if b.metrics is None else figure(b.metrics) for b in self.runs[kind]]
        return float(np.median([math.inf if math.isnan(value) else value for value in values]))

    def median_mse_um2(self, kind: str) -> float:
        """Median over the seeds of the objective."""
        return float(np.median([beetle.mse_um2 for beetle in self.runs[kind]]))

    def still_after(self, kind: str) -> float:
        """Median over the seeds of the iteration from which on the gains stand still."""
        return float(np.median([beetle.still_after for beetle in self.runs[kind]]))

    def typical(self, kind: str) -> Beetle:
        """The run whose objective is the median's next."""
        ordered = sorted(self.runs[kind], key=lambda beetle: beetle.mse_um2)
        return ordered[len(ordered) // 2]


def run_beetles(fmu: Path, seeds: int, evaluations: int, first_seed: int, report: Report) -> Beetles:
    """Run every kind with every seed."""
    settings = make_settings(objective="mse", evaluations=evaluations)
    runs: dict[str, list[Beetle]] = {kind: [] for kind in KINDS}
    with open_guarded(fmu) as (plant, _):
        problem = pose_problem(plant, settings)
        longer = replace(problem.experiment, duration_s=JUDGED_S)
        for seed in range(first_seed, first_seed + seeds):
            for kind in KINDS:
                found = _ours(problem, seed) if kind == "ours" else _raw(problem.objective, kind, seed, evaluations)
                runs[kind].append(found if kind == "noise" else _judged(found, longer))
                report(sum(map(len, runs.values())), seeds * len(KINDS), kind)
    return Beetles({kind: tuple(found) for kind, found in runs.items()})


def _raw(objective: Objective, kind: str, seed: int, evaluations: int) -> Beetle:
    """The printed algorithm in raw gains; told the negative of the objective it walks with a minus sign."""
    space, rng = RawSpace(), np.random.default_rng(seed)
    noise = np.random.default_rng([seed, 1])
    optimiser = create("bas_printed", DIMENSION, rng, budget=evaluations)
    places, best, value_there = [], None, math.inf
    for count in range(evaluations):
        x = optimiser.ask()
        value = float(noise.random()) if kind == "noise" else at_point(objective, space, x)
        optimiser.tell(x, -value if kind == "turned" else value)
        if count % PROBES:
            continue
        places.append(x)
        if value < value_there:
            best, value_there = x, value
    optimiser.close()
    gains = None if best is None or kind == "noise" else space.to_gains(best)
    return Beetle(np.array(places), gains, value_there)


def _ours(problem: TuningProblem, seed: int) -> Beetle:
    run = run_search(problem, "reliable_bas", seed=seed)
    if run.ended is Ended.INTERRUPTED:
        raise KeyboardInterrupt
    if run.ended is Ended.FAILED:
        raise RunError(run.reason)
    places, best = [], math.inf
    place = [math.nan] * DIMENSION
    for count, evaluation in enumerate(run.history):
        if evaluation.gains is not None and evaluation.value < best:
            g, best = evaluation.gains, evaluation.value
            place = [g.proportional_V_per_um, g.integral_V_per_um_s, g.derivative_V_s_per_um]
        if count % PROBES == 0:
            places.append(place)
    return Beetle(np.array(places), run.gains, run.value)


def _judged(beetle: Beetle, experiment: StepExperiment) -> Beetle:
    if beetle.gains is None:
        return beetle
    trace = experiment.run(beetle.gains)
    return replace(beetle, trace=trace, metrics=experiment.metrics(trace))
