"""Nelder-Mead simplex (Nelder & Mead 1965, doi:10.1093/comjnl/7.4.308), from scipy."""

import math

import numpy as np
from scipy.optimize import minimize

from bender_tuner.optimisers.inverted import Objective, inverted
from bender_tuner.optimisers.search import WORST, Search, Task

EDGE = 0.15
SMALLEST_SIMPLEX = 1e-4


def search(task: Task) -> Search:
    """One simplex with edges of random direction along the axes; ends when it has shrunk to nothing."""
    start = np.full(task.dimension, 0.5) if task.start is None else task.start
    edges = EDGE * task.rng.choice([-1.0, 1.0], task.dimension)
    corners = start + np.diag(np.where((start + edges >= 0.0) & (start + edges <= 1.0), edges, -edges))

    def run(objective: Objective) -> None:
        minimize(
            lambda x: min(objective(x), WORST),
            start,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * task.dimension,
            options={
                "initial_simplex": np.vstack([start, corners]),
                "xatol": SMALLEST_SIMPLEX,
                "fatol": math.inf,
                "maxfev": 10**9,
                "maxiter": 10**9,
            },
        )

    yield from inverted(run)
