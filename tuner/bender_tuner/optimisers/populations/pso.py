"""Particle swarm (Kennedy & Eberhart 1995, doi:10.1109/ICNN.1995.488968) with inertia (Shi & Eberhart 1998).

Each particle is drawn to the best point it has seen and to the best that any has seen. At a wall it stops.
"""

import numpy as np

from bender_tuner.optimisers.populations.first_generation import first_generation
from bender_tuner.optimisers.search import Probe, Search, Task

INERTIA, PULL = 0.5, 1.5
"""They let the swarm contract within some ten generations, which is what a budget of hundreds has; with the usual 0.73
and 1.5 it ends five times as far from the minimum of an ill-conditioned quadratic after 151 evaluations."""


def search(task: Task) -> Search:
    """A swarm sized to the budget, so that a small one leaves it time to move; particles move one by one."""
    rng = task.rng
    x = first_generation(task)
    velocity = 0.5 * (rng.random(x.shape) - x)
    best_x, best_f = x.copy(), np.full(len(x), np.inf)
    for k, point in enumerate(x):
        best_f[k] = yield Probe(point)
    while True:
        for k in range(len(x)):
            leader = best_x[int(np.argmin(best_f))]
            own, common = PULL * rng.random((2, task.dimension))
            velocity[k] = INERTIA * velocity[k] + own * (best_x[k] - x[k]) + common * (leader - x[k])
            moved = x[k] + velocity[k]
            x[k] = np.clip(moved, 0.0, 1.0)
            velocity[k, moved != x[k]] = 0.0
            f = yield Probe(x[k].copy())
            if f < best_f[k]:
                best_x[k], best_f[k] = x[k], f
