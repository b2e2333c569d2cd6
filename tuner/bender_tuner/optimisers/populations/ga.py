"""Genetic algorithm with real coding (Deb & Agrawal 1995), from pymoo."""

from pymoo.algorithms.soo.nonconvex.ga import GA

from bender_tuner.optimisers.populations.pymoo_batches import batches, first_generation
from bender_tuner.optimisers.search import Search, Task


def search(task: Task) -> Search:
    """Tournament selection, simulated binary crossover, polynomial mutation, the best survive."""
    return batches(GA(pop_size=task.population, sampling=first_generation(task)), task)
