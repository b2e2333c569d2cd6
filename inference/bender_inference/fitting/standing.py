"""What the numbers of a fitted hypothesis would take over once a further effect stands beside them.

Around its best numbers a hypothesis is taken as linear in them. Whatever a change of theirs could do to the readings is
projected out of everything that a further effect is held against:

    M = I - Q Q',      Q a basis of the columns of [J; diag(s / p)]

J holds the slopes of the residual by the coordinates of the numbers, s is the rms that the hypothesis leaves and p the
size within which a number may move: the partial regression of Frisch, Waugh and Lovell, with a ridge. So an effect
promises what a fit of all numbers would find, at the price of a scan.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_compiled.parallel_map import parallel_map
from bender_effects.form import Free
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.output_error import Fitted, training_residual
from bender_inference.records.observations import Array

# of a coordinate, for a slope
STEP = 5e-3
# a direction weaker than this beside the strongest one is rounding
LEAST = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """The slopes of a hypothesis on the training rows of all records, and what projects them out.

    Attributes:
        slopes: (n, k) of the residual by the coordinate of every number; k may be 0.
        ridge: (k,) s / p of every number.
        basis: (n + k, r) Q.
    """

    slopes: Array
    ridge: Array
    basis: Array

    def of(self, rows: NDArray[np.intp]) -> "Standing":
        """Return the same for some of the rows, each of which stands for as many as are left out."""
        share = math.sqrt(rows.size / max(self.slopes.shape[0], 1))
        return _standing(self.slopes[rows], self.ridge * share)

    def weighted(self, weights: Array) -> "Standing":
        """Return the same where every row (n,) shows only so much of the slopes."""
        return _standing(self.slopes * weights[:, None], self.ridge)

    def without_it(self, column: Array) -> Array:
        """Return a column (n,), or several (n, m), without what the numbers could take over, shape (n + k, ...)."""
        longer = np.concatenate([column, np.zeros((self.ridge.size, *column.shape[1:]))])
        return longer - self.basis @ (self.basis.T @ longer)

    def square(self, residual: Array) -> float:
        """Return the sum of squares of a residual (n,) once the numbers have taken over what they can."""
        left = self.without_it(residual)
        return float(left @ left)


def _standing(slopes: Array, ridge: Array) -> Standing:
    return Standing(slopes, ridge, _basis(np.concatenate([slopes, np.diag(ridge)])))


def _basis(columns: Array) -> Array:
    sizes = np.linalg.norm(columns, axis=0)
    if not np.any(sizes > 0.0):
        return np.zeros((columns.shape[0], 0))
    columns = columns[:, sizes > 0.0] / sizes[sizes > 0.0]
    left, strength, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, strength > LEAST * strength[0]]


def within(free: Free, value: float) -> float:
    """Return how far the coordinate of a number may go: a factor of e for scales, its own size for amplitudes."""
    return 1.0 if free.log else 1.0 + abs(free.inward(value))


def standing(problem: FitProblem, fitted: Fitted) -> Standing:
    """Return the slopes of a fitted hypothesis, by rough simulations; none where it has no numbers."""
    free, values = fitted.hypothesis.free, fitted.hypothesis.values()
    here = training_residual(problem, fitted.hypothesis, roughly=True) if free else None
    if here is None:
        rows = sum(int(x.training.sum()) for x in problem.observations)
        return _standing(np.zeros((rows, 0)), np.zeros(0))

    def column(k: int) -> Array:
        for step in (STEP, -STEP):
            moved = list(values)
            moved[k] = free[k].outward(free[k].inward(values[k]) + step)
            distance = free[k].inward(moved[k]) - free[k].inward(values[k])
            found = training_residual(problem, fitted.hypothesis.with_values(moved), roughly=True)
            if found is not None and distance != 0.0:
                return (found - here) / distance
        return np.zeros_like(here)

    left = math.sqrt(float(np.mean(here**2)))
    sizes = np.array([within(x, v) for x, v in zip(free, values, strict=True)])
    return _standing(np.stack(parallel_map(column, range(len(free))), axis=1), left / sizes)
