"""Blocked cross-validation: each block of the readings, predicted from all others.

Around a fitted hypothesis the readings are taken as linear in its numbers. What block b leaves once it has no part in
the fit is then

    r'_b = r_b + J_b (A - J_b' J_b)^-1 J_b' r_b,      A = J' J + s^2 P

the multivariate form of Allen's PRESS (1974), with the slopes J that the intervals need as well: no refit. P keeps a
number that the other blocks do not determine within its own size.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.output_error import Fitted
from bender_inference.fitting.standing import within
from bender_inference.fitting.uncertainty import columns
from bender_inference.records.observations import Array

# standard errors by which a gain must exceed nought: the one-standard-error rule (Breiman and others 1984)
ERRORS = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class _Blocks:
    """The searched rows of all records beneath one another.

    Attributes:
        slopes: (n, k) of the readings by every number.
        left: (n,) measured minus simulated.
        block: (n,) which block every row is in.
        prior: (k,) deviation within which a number stays that nothing determines; inf for no limit.
    """

    slopes: Array
    left: Array
    block: NDArray[np.int64]
    prior: Array


def predicted_residuals(problem: FitProblem, fitted: Fitted) -> list[Array] | None:
    """Return (n,) of every record, what a hypothesis leaves of each block when fitted to all others; 0 elsewhere.

    None where it cannot be simulated.
    """
    x = _blocks(problem, fitted)
    if x is None:
        return None
    predicted = predicted_errors(x.slopes, x.left, x.block, x.prior)
    found, begin = [], 0
    for m in (y.searched for y in problem.observations):
        errors = np.zeros(m.size)
        errors[m] = predicted[begin : begin + int(m.sum())]
        found.append(errors)
        begin += int(m.sum())
    return found


def least_beside_a_block(problem: FitProblem, fitted: Fitted) -> float:
    """Return the mean square that a hypothesis leaves of all blocks but one, fitted to these: of the best such choice.

    What only one block shows is not in it. inf where the hypothesis cannot be simulated.
    """
    x = _blocks(problem, fitted)
    if x is None:
        return math.inf
    squares = []
    for k in np.unique(x.block):
        slopes, left = x.slopes[x.block != k], x.left[x.block != k]
        a = slopes.T @ slopes + np.diag(float(np.mean(left**2)) / x.prior**2)
        squares.append(float(np.mean((left - slopes @ _solved(a, slopes.T @ left)) ** 2)) if left.size else math.inf)
    return min(squares, default=math.inf)


def _blocks(problem: FitProblem, fitted: Fitted) -> _Blocks | None:
    readings = problem.readings(fitted.hypothesis)
    if readings is None:
        return None
    rows = [x.searched for x in problem.observations]
    slopes = columns(problem, fitted, readings, rows)
    left = np.concatenate([r[m] for r, m in zip(fitted.residuals, rows, strict=True)])
    # a coarse reading within its step is left as it is, whatever the numbers do
    inside = np.concatenate(
        [np.full(int(m.sum()), x.half_step_um > 0.0) for m, x in zip(rows, problem.observations, strict=True)]
    )
    slopes[inside & (left == 0.0)] = 0.0
    block, first = [], 0
    for x in problem.observations:
        block.append(first + x.folds[x.searched])
        first = int(block[-1].max(initial=first)) + 1
    return _Blocks(slopes, left, np.concatenate(block), _prior(fitted, slopes.shape[1]))


def predicted_errors(slopes: Array, left: Array, block: NDArray[np.int64], prior: Array) -> Array:
    """Return the residual of every row (n,), its block held out of the fit.

    Args:
        slopes: (n, k) of the readings by every number.
        left: (n,) measured minus simulated.
        block: (n,) which block every row is in.
        prior: (k,) deviation within which a number stays that nothing determines; inf for no limit.
    """
    noise = float(np.mean(left**2))
    a = slopes.T @ slopes + np.diag(noise / prior**2)
    left = left - slopes @ _solved(a, slopes.T @ left)
    found = np.empty_like(left)
    for k in np.unique(block):
        rows = block == k
        own = slopes[rows]
        found[rows] = left[rows] + own @ _solved(a - own.T @ own, own.T @ left[rows])
    return found


def _solved(matrix: Array, right: Array) -> Array:
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return np.linalg.lstsq(matrix / np.outer(scale, scale), right / scale, rcond=1e-12)[0] / scale


def _prior(fitted: Fitted, count: int) -> Array:
    """Return how far the coordinate of every number may go: a factor of e for scales, its own size for amplitudes."""
    free, values = fitted.hypothesis.free, fitted.hypothesis.values()
    own = [within(x, v) for x, v in zip(free, values, strict=True)]
    return np.concatenate([own, np.full(count - len(own), math.inf)])
