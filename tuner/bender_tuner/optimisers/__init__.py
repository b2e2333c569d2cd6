"""Optimisers with ask and tell: they never call the objective, so a plant, a bench and a toy function look alike.

>>> optimiser = create("reliable_bas", dimension=3, rng=numpy.random.default_rng(1))
>>> for _ in range(151):
...     x = optimiser.ask()
...     optimiser.tell(x, loss(x))
>>> optimiser.best_x, optimiser.best_f

`METHODS` lists what there is; each algorithm has a file of its own, and its library is imported when it is first
used. This package itself costs nothing to import.
"""

from bender_tuner.optimisers.methods import DEFAULT_BUDGET, METHODS, MethodInfo, create
from bender_tuner.optimisers.optimiser import Optimiser

__all__ = ["DEFAULT_BUDGET", "METHODS", "MethodInfo", "Optimiser", "create"]
