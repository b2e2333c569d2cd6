"""DIRECT, dividing rectangles in its locally biased form (Gablonsky & Kelley 2001), from scipy.

Deterministic: it begins at the centre of the box and uses neither the start nor the generator until it is done;
from there on the points are uniform random.
"""

from scipy.optimize import direct

from bender_tuner.optimisers import random_points
from bender_tuner.optimisers.inverted import Objective, inverted
from bender_tuner.optimisers.search import Search, Task


def search(task: Task) -> Search:
    """Rectangles are divided until about 1000 d evaluations or ten budgets are spent, whichever is more."""
    most = max(10 * task.budget, 1000 * task.dimension)

    def run(objective: Objective) -> None:
        direct(
            objective,
            bounds=[(0.0, 1.0)] * task.dimension,
            maxfun=most,
            maxiter=most,
            locally_biased=True,
            vol_tol=0.0,
            len_tol=0.0,
        )

    yield from inverted(run)
    yield from random_points.search(task)
