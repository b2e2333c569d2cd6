"""Uniform random points of the unit box: what any method has to beat."""

from bender_tuner.optimisers.search import Probe, Search, Task


def search(task: Task) -> Search:
    """The start, if one is given, then independent uniform points."""
    if task.start is not None:
        yield Probe(task.start)
    while True:
        yield Probe(task.rng.random(task.dimension))
