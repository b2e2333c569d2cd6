"""Generations of a pymoo algorithm, handed out point by point."""

from typing import Any

import numpy as np
from pymoo.config import Config
from pymoo.core.evaluator import Evaluator
from pymoo.core.problem import Problem
from pymoo.core.termination import NoTermination
from pymoo.problems.static import StaticProblem
from scipy.stats import qmc

from bender_tuner.optimisers.search import Probe, Search, Task

# Without its compiled modules pymoo prints a hint to the terminal; nothing used here would gain from them.
Config.warnings["not_compiled"] = False


def batches(algorithm: Any, task: Task) -> Search:
    """Search over the unit box that asks for what `algorithm` asks for; ends if it has no more points."""
    problem = Problem(n_var=task.dimension, n_obj=1, xl=0.0, xu=1.0)
    algorithm.setup(problem, termination=NoTermination(), seed=int(task.rng.integers(2**31)))
    while (generation := algorithm.ask()) is not None:
        values = []
        for individual in generation:
            values.append((yield Probe(np.clip(individual.X, 0.0, 1.0))))
        Evaluator().eval(StaticProblem(problem, F=np.array(values)[:, None]), generation)
        algorithm.tell(infills=generation)


def first_generation(task: Task) -> Any:
    """A Latin hypercube of points, shape (population, d), in which the start replaces the first."""
    points = qmc.LatinHypercube(task.dimension, rng=task.rng).random(task.population)
    if task.start is not None:
        points[0] = task.start
    return points
