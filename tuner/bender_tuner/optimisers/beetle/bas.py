"""Beetle antennae search with its sign corrected, and otherwise unchanged.

After Jiang & Li, BAS: Beetle Antennae Search Algorithm for Optimization Problems (arXiv:1710.10724). Against the
printed form: a minus sign in (25), so that the beetle descends; coordinates in the unit box, so that one step length
suits all of them; every point smelled is a candidate; the antenna shrinks to half a percent of the box instead
of 0.2 raw units; and antennae that smell the same thing do not freeze the beetle, it turns instead.
"""

import numpy as np

from bender_tuner.optimisers.beetle.bas_printed import random_direction, sign_of_difference
from bender_tuner.optimisers.search import Probe, Search, Task

DECAY = 0.95
SHORTEST_ANTENNA = 0.005


def search(task: Task, antenna: float = 0.05, stride: float = 0.1) -> Search:
    """Corrected Algorithm 1; `antenna` is d_0 and `stride` is delta_0, as parts of the box."""
    x = np.full(task.dimension, 0.5) if task.start is None else task.start
    d, delta = antenna, stride
    yield Probe(x)
    while True:
        b = random_direction(task.rng, task.dimension)  # (22)
        f_right = yield Probe(np.clip(x + d * b, 0.0, 1.0))  # (23)
        f_left = yield Probe(np.clip(x - d * b, 0.0, 1.0))  # (24)
        side = sign_of_difference(f_right, f_left)
        if side != 0:
            x = np.clip(x - delta * b * side, 0.0, 1.0)  # (25) with a minus sign
            yield Probe(x)
        d = DECAY * d + (1.0 - DECAY) * SHORTEST_ANTENNA  # (26)
        delta = DECAY * delta  # (27)
