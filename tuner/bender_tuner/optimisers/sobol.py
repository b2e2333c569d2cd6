"""Scrambled Sobol points: random search without the clumps (Sobol' 1967, Owen 1998), from scipy."""

from scipy.stats import qmc

from bender_tuner.optimisers.search import Probe, Search, Task

BITS = 30


def search(task: Task) -> Search:
    """The start, if one is given, then the sequence in order; it ends after 2^30 points."""
    if task.start is not None:
        yield Probe(task.start)
    sequence = qmc.Sobol(task.dimension, bits=BITS, rng=task.rng)
    for _ in range(2**BITS):
        yield Probe(sequence.random(1)[0])
