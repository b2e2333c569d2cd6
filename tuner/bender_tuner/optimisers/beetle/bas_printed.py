"""Beetle antennae search exactly as printed ("paper mode"), to show what it does: it climbs.

Musa & Wejinya 2024, Algorithm 1 with equations (22)-(27), d_0 = delta_0 = 1, x_0 ~ U[0, 1]^k. What is kept on
purpose: the plus sign of (25), which walks towards the larger value although Algorithm 1 keeps the smaller;
sign(0) = 0, so the beetle stands still on a plateau; antennae that are smelled but never kept; raw coordinates
without bounds, so that the caller decides what an impossible point is worth.
"""

import numpy as np

from bender_tuner.optimisers.search import Point, Probe, Search, Task


def search(task: Task, antenna: float = 1.0, stride: float = 1.0) -> Search:
    """Algorithm 1; `antenna` is d_0 and `stride` is delta_0, both in raw coordinates."""
    x = task.rng.random(task.dimension) if task.start is None else task.start
    d, delta = antenna, stride
    yield Probe(x)
    while True:
        b = random_direction(task.rng, task.dimension)  # (22)
        f_right = yield Probe(x + d * b, credited=False)  # (23)
        f_left = yield Probe(x - d * b, credited=False)  # (24)
        x = x + delta * b * sign_of_difference(f_right, f_left)  # (25)
        yield Probe(x)
        d = 0.95 * d + 0.01  # (26)
        delta = 0.95 * delta  # (27)


def random_direction(rng: np.random.Generator, dimension: int) -> Point:
    """A direction drawn uniformly from the unit sphere, shape (d,)."""
    b = rng.standard_normal(dimension)
    return b / np.linalg.norm(b)


def sign_of_difference(a: float, b: float) -> int:
    """sign(a - b) that also holds for infinite values: two of them are equal."""
    return (a > b) - (a < b)
