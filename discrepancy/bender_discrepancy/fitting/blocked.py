"""Would an effect be named again on other blocks? Blocked cross-validation, each block predicted from all others.

Around a fitted hypothesis the readings are taken as linear in its numbers. What block b leaves once it has no part in
the fit is then

    r'_b = r_b + J_b (A - J_b' J_b)^-1 J_b' r_b,      A = J' J + s^2 P

the multivariate form of Allen's PRESS (1974), with the slopes J that the intervals need as well: no refit. P keeps a
number that the other blocks do not determine within its own size.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.fitting.standing import within
from bender_discrepancy.fitting.uncertainty import columns
from bender_discrepancy.records.observations import Array
from bender_discrepancy.records.roles import folds_of

# standard errors by which a gain must exceed nought: the one-standard-error rule (Breiman and others 1984)
ERRORS = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class BlockScores:
    """Sums of squares of every block that holds readings, predicted from the others; shape (b,)."""

    square: Array

    def is_ahead_of(self, other: "BlockScores") -> bool:
        """Return whether this one leaves less than another by more than the standard error over blocks.

        A block that alone determines a number is foretold by nothing, and its square is as large as it happens to be:
        it makes the error of a sum as large as the sum. So what the squares or what their logarithms say counts.
        """
        ratio = np.log(np.maximum(other.square, 1e-300) / np.maximum(self.square, 1e-300))
        return _exceeds_its_error(other.square - self.square) or _exceeds_its_error(ratio)


def _exceeds_its_error(gain: Array) -> bool:
    spread = float(np.std(gain, ddof=1)) if gain.size > 1 else math.inf
    return float(np.sum(gain)) > ERRORS * spread * math.sqrt(gain.size)


def block_scores(problem: FitProblem, fitted: Fitted) -> BlockScores | None:
    """Return what a hypothesis leaves in every block when fitted to all others; None where it cannot be simulated."""
    readings = problem.readings(fitted.hypothesis)
    if readings is None:
        return None
    slopes = columns(problem, fitted, readings, [x.searched for x in problem.observations])
    left = np.concatenate([r[x.searched] for r, x in zip(fitted.residuals, problem.observations, strict=True)])
    block, first = [], 0
    for x in problem.observations:
        block.append(first + folds_of(x.usable)[x.searched])
        first = int(block[-1].max(initial=first)) + 1
    return BlockScores(predicted_squares(slopes, left, np.concatenate(block), _prior(fitted, slopes.shape[1])))


def predicted_residuals(problem: FitProblem, fitted: Fitted) -> list[Array] | None:
    """Return (n,) of every record, what a hypothesis leaves of each block when fitted to all others; 0 elsewhere.

    None where it cannot be simulated.
    """
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
        block.append(first + folds_of(x.usable)[x.searched])
        first = int(block[-1].max(initial=first)) + 1
    predicted = _predicted(slopes, left, np.concatenate(block), _prior(fitted, slopes.shape[1]))
    found, begin = [], 0
    for m in rows:
        errors = np.zeros(m.size)
        errors[m] = predicted[begin : begin + int(m.sum())]
        found.append(errors)
        begin += int(m.sum())
    return found


def _predicted(slopes: Array, left: Array, block: NDArray[np.int64], prior: Array) -> Array:
    """Return what is left of every row (n,) of a block that had no part in the fit."""
    noise = float(np.mean(left**2))
    a = slopes.T @ slopes + np.diag(noise / prior**2)
    left = left - slopes @ _solved(a, slopes.T @ left)
    found = np.empty_like(left)
    for k in np.unique(block):
        rows = block == k
        own = slopes[rows]
        found[rows] = left[rows] + own @ _solved(a - own.T @ own, own.T @ left[rows])
    return found


def predicted_squares(slopes: Array, left: Array, block: NDArray[np.int64], prior: Array) -> Array:
    """Return the sum of squares of every block, predicted from the others.

    Args:
        slopes: (n, k) of the readings by every number.
        left: (n,) measured minus simulated.
        block: (n,) which block every row is in.
        prior: (k,) deviation within which a number stays that nothing determines; inf for no limit.
    """
    noise = float(np.mean(left**2))
    a = slopes.T @ slopes + np.diag(noise / prior**2)
    # the numbers were fitted to some of the rows: one step to all of them
    left = left - slopes @ _solved(a, slopes.T @ left)
    found = []
    for k in np.unique(block):
        rows = block == k
        own = slopes[rows]
        moved = _solved(a - own.T @ own, own.T @ left[rows])
        found.append(float(np.sum((left[rows] + own @ moved) ** 2)))
    return np.array(found)


def _solved(matrix: Array, right: Array) -> Array:
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return np.linalg.lstsq(matrix / np.outer(scale, scale), right / scale, rcond=1e-12)[0] / scale


def _prior(fitted: Fitted, count: int) -> Array:
    """Return how far the coordinate of every number may go: a factor of e for scales, its own size for amplitudes."""
    free, values = fitted.hypothesis.free, fitted.hypothesis.values()
    own = [within(x, v) for x, v in zip(free, values, strict=True)]
    return np.concatenate([own, np.full(count - len(own), math.inf)])


def again_on_other_blocks(problem: FitProblem, fitted: Fitted, without: Fitted) -> bool:
    """Return whether blocks that had no part in a fit favour a hypothesis over one without one of its effects."""
    return not doubtful(problem, fitted, [without])


def doubtful(problem: FitProblem, fitted: Fitted, without: Sequence[Fitted]) -> list[Fitted]:
    """Return those of some shorter hypotheses that blocks which had no part in a fit do not clearly put behind."""
    own = block_scores(problem, fitted)
    found = []
    for shorter in without:
        other = None if own is None else block_scores(problem, shorter)
        if own is None or other is None:
            found.append(shorter)
            continue
        if not own.is_ahead_of(other):
            found.append(shorter)
    return found
