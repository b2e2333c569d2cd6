"""CMA-ES (Hansen & Ostermeier 2001, doi:10.1162/106365601750190398), from pycma."""

import cma
import numpy as np

from bender_tuner.optimisers.search import WORST, Point, Probe, Search, Task

FIRST_SIGMA = 0.2


def search(task: Task) -> Search:
    """One strategy with the default population; ends when pycma calls it converged."""

    def normal(*shape: int) -> Point:
        return task.rng.standard_normal(shape)

    options = {
        "bounds": [0.0, 1.0],
        "randn": normal,
        "seed": np.nan,
        "verbose": -9,
        "verb_log": 0,
        "verb_disp": 0,
    }
    start = np.full(task.dimension, 0.5) if task.start is None else task.start
    strategy = cma.CMAEvolutionStrategy(start, FIRST_SIGMA, options)
    while not strategy.stop():
        points = strategy.ask()
        values = []
        for x in points:
            values.append(min((yield Probe(np.clip(x, 0.0, 1.0))), WORST))
        strategy.tell(points, values)
