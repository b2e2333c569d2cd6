"""What swarms and genetic algorithms begin with."""

from scipy.stats import qmc

from bender_tuner.optimisers.search import Point, Task


def first_generation(task: Task) -> Point:
    """Return a Latin hypercube of points, shape (population, d), in which the start replaces the first."""
    points = qmc.LatinHypercube(task.dimension, rng=task.rng).random(task.population)
    if task.start is not None:
        points[0] = task.start
    return points
