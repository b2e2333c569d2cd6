"""Particle swarm (Kennedy & Eberhart 1995; adaptive weights of Zhan et al. 2009), from pymoo."""

from pymoo.algorithms.soo.nonconvex.pso import PSO

from bender_tuner.optimisers.populations.pymoo_batches import batches, first_generation
from bender_tuner.optimisers.search import Search, Task


def search(task: Task) -> Search:
    """A swarm sized to the budget, so that a small one leaves it time to move."""
    return batches(PSO(pop_size=task.population, sampling=first_generation(task)), task)
