"""Differential evolution, best/1/bin (Storn & Price 1997, doi:10.1023/A:1008202821328), from scipy."""

from scipy.optimize import differential_evolution

from bender_tuner.optimisers.inverted import Objective, inverted
from bender_tuner.optimisers.search import Search, Task


def search(task: Task) -> Search:
    """Ends when all members have the same value; the population leaves generations to a small budget."""

    def run(objective: Objective) -> None:
        differential_evolution(
            objective,
            bounds=[(0.0, 1.0)] * task.dimension,
            x0=task.start,
            popsize=max(1, task.population // task.dimension),
            maxiter=10**9,
            tol=0.0,
            polish=False,
            rng=task.rng,
        )

    yield from inverted(run)
