"""Genetic algorithm with real coding: simulated binary crossover (Deb & Agrawal 1995), polynomial mutation (Deb 2001).

Parents are chosen by tournaments of two; of parents and children the better half survives.
"""

import numpy as np

from bender_tuner.optimisers.populations.first_generation import first_generation
from bender_tuner.optimisers.search import Point, Probe, Search, Task

CROSSED, SPREAD_OF_CHILDREN, SPREAD_OF_MUTANTS = 0.9, 15.0, 20.0
"""Share of couples that cross, and the distribution indices: the larger, the nearer to the parents (Deb's values)."""


def search(task: Task) -> Search:
    """Generations of as many children as there are members."""
    rng = task.rng
    members = first_generation(task)
    values = np.full(len(members), np.inf)
    for k, point in enumerate(members):
        values[k] = yield Probe(point)
    while True:
        children = np.array([mutant(child(*_couple(members, values, rng), rng), rng) for _ in members])
        found = np.empty(len(children))
        for k, point in enumerate(children):
            found[k] = yield Probe(point)
        members, values = np.concatenate([members, children]), np.concatenate([values, found])
        survivors = np.argsort(values, kind="stable")[: len(children)]
        members, values = members[survivors], values[survivors]


def _couple(members: Point, values: Point, rng: np.random.Generator) -> tuple[Point, Point]:
    first, second = (min(rng.integers(len(members), size=2), key=lambda k: values[k]) for _ in range(2))
    return members[first], members[second]


def child(a: Point, b: Point, rng: np.random.Generator) -> Point:
    """Return one of the two children of a couple, within [0, 1]: its mean is theirs, its spread that of one bit."""
    if rng.random() > CROSSED:
        return a.copy()
    u = rng.random(a.size)
    power = 1.0 / (SPREAD_OF_CHILDREN + 1.0)
    spread = np.where(u <= 0.5, (2.0 * u) ** power, (1.0 / (2.0 * (1.0 - u))) ** power)
    side = np.where(rng.random(a.size) < 0.5, 1.0, -1.0)
    crossed = rng.random(a.size) < 0.5
    return np.where(crossed, np.clip(0.5 * (a + b) + side * 0.5 * spread * (a - b), 0.0, 1.0), a)


def mutant(x: Point, rng: np.random.Generator) -> Point:
    """Return `x` with each coordinate changed at odds of one in d, within [0, 1]."""
    u = rng.random(x.size)
    power = SPREAD_OF_MUTANTS + 1.0
    down = (2.0 * u + (1.0 - 2.0 * u) * (1.0 - x) ** power) ** (1.0 / power) - 1.0
    up = 1.0 - (2.0 * (1.0 - u) + (2.0 * u - 1.0) * x**power) ** (1.0 / power)
    chosen = rng.random(x.size) < 1.0 / x.size
    return np.where(chosen, np.clip(x + np.where(u < 0.5, down, up), 0.0, 1.0), x)
