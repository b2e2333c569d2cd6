"""Optimisers with ask and tell: they never call the objective, so a plant, a bench and a toy function look alike.

>>> optimiser = create("reliable_bas", dimension=3, rng=numpy.random.default_rng(1))
>>> for _ in range(151):
...     x = optimiser.ask()
...     optimiser.tell(x, loss(x))
>>> optimiser.best_x, optimiser.best_f

`METHODS` lists what there is; each algorithm has a file of its own, and its library is imported when it is first
used. This package itself costs nothing to import.

| module | holds |
|---|---|
| `ask_tell` | turns a search written as a generator into an optimiser with ask and tell |
| `differential_evolution` | differential evolution |
| `inverted` | turns a function that calls its objective into a search that asks for values |
| `methods` | the table of methods and the one way to make an optimiser |
| `nelder_mead` | Nelder-Mead simplex (Nelder & Mead 1965, doi:10.1093/comjnl/7.4.308), from scipy |
| `optimiser` | what the outside sees of every search: ask for a point, tell its value |
| `pattern_search` | pattern search of Hooke and Jeeves |
| `random_points` | uniform random points of the unit box: what any method has to beat |
| `search` | how an algorithm is written here: as a generator function over probes |
| `beetle/` | beetle antennae search |
| `populations/` | genetic algorithm and particle swarm, and what both begin with |
"""

from bender_tuner.optimisers.methods import DEFAULT_BUDGET, METHODS, MethodInfo, create
from bender_tuner.optimisers.optimiser import Optimiser

__all__ = ["DEFAULT_BUDGET", "METHODS", "MethodInfo", "Optimiser", "create"]
