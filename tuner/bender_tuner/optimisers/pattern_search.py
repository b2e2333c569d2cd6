"""Pattern search of Hooke and Jeeves (Direct search, J. ACM 8, 1961, doi:10.1145/321062.321069).

Written here because pymoo 0.6.2, against which it is tested, draws the order of the coordinates from an unseeded
generator, so that no run of its PatternSearch can be repeated. Same rules and settings as there; in one dimension,
where the order is void, a test holds the two to the same points.
"""

from collections.abc import Generator

import numpy as np

from bender_tuner.optimisers.search import Point, Probe, Search, Task

FIRST_STEP = 0.125
CONTRACTION = 0.5
SMALLEST_STEP = 1e-6


def search(task: Task) -> Search:
    """Explores around the centre, repeats what helped, halves the step when nothing does; ends at the smallest."""
    x = np.full(task.dimension, 0.5) if task.start is None else task.start
    f = yield Probe(x)
    signs = np.ones(task.dimension)
    step = FIRST_STEP
    while step >= SMALLEST_STEP:
        explored, f_explored = yield from _explore(x, f, step * signs, task.rng)
        while f_explored < f:
            move = explored - x
            x, f = explored, f_explored
            trial = np.clip(x + move, 0.0, 1.0)
            f_trial = yield Probe(trial)
            signs = np.where(move > 0.0, 1.0, -1.0)
            explored, f_explored = yield from _explore(trial, f_trial, step * signs, task.rng)
        step *= CONTRACTION


def _explore(
    x: Point, f: float, steps: Point, rng: np.random.Generator
) -> Generator[Probe, float, tuple[Point, float]]:
    """Try a step along each axis, then its opposite, in random order; keep what is better."""
    for axis in rng.permutation(x.size):
        for step in (steps[axis], -steps[axis]):
            trial = x.copy()
            trial[axis] = np.clip(x[axis] + step, 0.0, 1.0)
            f_trial = yield Probe(trial)
            if f_trial < f:
                x, f = trial, f_trial
                break
    return x, f
