"""How well the records determine what was fitted: the numbers of the effects, the gain and the offsets together.

    C = s^2 T (J' J)^-1

J holds the slopes of the readings by every fitted number at once, so that what one number can take over from another
counts; s is the rms of the residual and T the rows that count as one independent reading (criterion.py).

This assumes residuals of one size in every row. With jitter in the time stamps, or pictures blurred by motion, they are
largest in the rows where the tip moves, and those rows determine a delay or a lag. So the sandwich estimate

    C = (J' J)^-1 S (J' J)^-1,    S = sum_l (1 - |l| / (L + 1)) sum_k g_k g_(k+l)',    g_k = J_k r_k / (1 - h_k)

is computed too, with the products of neighbouring rows and without them (Newey and West 1987, doi:10.2307/1913610) and
with the leverage h_k of every row (MacKinnon and White 1985, doi:10.1016/0304-4076(85)90158-7). It is itself uncertain
where few rows determine a number, so it is widened as Student's distribution is, with Satterthwaite's degrees of
freedom (Bell and McCaffrey 2002) from the rows' own shares. The largest of the three counts.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri, stdtrit

from bender_compiled.parallel_map import parallel_map
from bender_effects.form import Free
from bender_inference.fitting.criterion import independent_rows
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.level_cell import cell_of, is_undetermined
from bender_inference.fitting.output_error import Fitted
from bender_inference.records.observations import Array, Mask, have_same_zero

STEP = 2e-3
# a direction that moves the readings less than this beside the strongest one is not determined at all
LEAST_DETERMINED = 1e-7
MOST_LEVERAGE = 0.9
WITHIN = 0.975
"""Up to this quantile a deviation stands for an interval of 95 %."""


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """Standard deviations of what was fitted; inf where the records cannot tell.

    Attributes:
        coordinates: (k, k) covariance of the coordinates in which the free numbers are searched.
        gain: of the factor on the reading.
        offsets_um: of the constant added to the reading, for every record.
        with_gain: (k,) covariance of each coordinate with that factor.
    """

    coordinates: Array
    gain: float
    offsets_um: tuple[float, ...]
    with_gain: Array


def free_numbers(fitted: Fitted) -> list[Free]:
    """Return all free numbers of a hypothesis, in order."""
    return list(fitted.hypothesis.free)


def moved(free: Sequence[Free], values: Sequence[float], k: int) -> tuple[list[float], list[float], float]:
    """Return values with number k a small step down and up within its bounds, and how far its coordinate moved."""
    down, up = list(values), list(values)
    middle = free[k].inward(values[k])
    down[k], up[k] = free[k].outward(middle - STEP), free[k].outward(middle + STEP)
    return down, up, free[k].inward(up[k]) - free[k].inward(down[k])


def _slope(problem: FitProblem, fitted: Fitted, k: int) -> list[Array] | None:
    """Return the slope of every record's readings by one coordinate, None where it cannot be moved."""
    free, values = free_numbers(fitted), fitted.hypothesis.values()
    down, up, distance = moved(free, values, k)
    cell = cell_of(problem, fitted)
    if cell is not None and cell.number == k:
        # beyond the cell a command changes its level: the readings jump, and a jump is no slope
        down[k], up[k] = cell.beside(values[k])
        distance = free[k].inward(up[k]) - free[k].inward(down[k])
    before = problem.readings(fitted.hypothesis.with_values(down))
    after = problem.readings(fitted.hypothesis.with_values(up))
    if before is None or after is None or distance == 0.0:
        return None
    return [fitted.calibration.gain * (b - a) / distance for a, b in zip(before, after, strict=True)]


def columns(problem: FitProblem, fitted: Fitted, readings: list[Array], rows: Sequence[Mask]) -> Array:
    """Return J on some rows of every record: coordinates, gain, offsets.

    Args:
        problem: what the hypothesis was fitted to.
        fitted: the hypothesis.
        readings: that it gives, of every record.
        rows: of every record, which ones.
    """
    still = [np.zeros_like(y) for y in readings]
    found = parallel_map(lambda k: _slope(problem, fitted, k) or still, range(fitted.hypothesis.free_count))
    found.append(readings)
    if have_same_zero(problem.observations):
        found.append([np.ones_like(y) for y in readings])
    else:
        for record in range(len(readings)):
            found.append([np.full_like(y, float(k == record)) for k, y in enumerate(readings)])
    return np.stack([np.concatenate([y[m] for y, m in zip(x, rows, strict=True)]) for x in found], axis=1)


def _covariance(columns: Array) -> Array:
    """Return (J' J)^-1 with inf on the diagonal where a number is not determined."""
    sizes = np.linalg.norm(columns, axis=0)
    known = sizes > 0.0
    covariance = np.diag(np.full(sizes.size, math.inf))
    if not known.any():
        return covariance
    _, strength, directions = np.linalg.svd(columns[:, known] / sizes[known], full_matrices=False)
    determined = strength > LEAST_DETERMINED * strength[0]
    weighed = directions[determined] / strength[determined, None]
    inverse = weighed.T @ weighed
    lost = np.any(np.abs(directions[~determined]) > 0.1, axis=0)
    inverse[lost, lost] = math.inf
    covariance[np.ix_(known, known)] = inverse / np.outer(sizes[known], sizes[known])
    return covariance


def sandwich(slopes: Array, inverse: Array, residual: Array) -> Array:
    """Return the diagonal of the covariance for residuals whose size varies by row; 0 for undetermined numbers.

    Args:
        slopes: (n, k) of the readings by every number.
        inverse: (k, k) of their products, inf where a number is not determined.
        residual: (n,).
    """
    count = residual.size
    known = np.where(np.isfinite(inverse), inverse, 0.0)
    leverage = np.einsum("ij,jk,ik->i", slopes, known, slopes)
    shares = (slopes @ known) * (residual / (1.0 - np.clip(leverage, 0.0, MOST_LEVERAGE)))[:, None]
    alone = np.sum(shares**2, axis=0)
    neighbours = alone.copy()
    lags = int(4.0 * (count / 100.0) ** (2.0 / 9.0))
    for lag in range(1, min(lags, count - 1) + 1):
        neighbours += 2.0 * (1.0 - lag / (lags + 1.0)) * np.sum(shares[lag:] * shares[:-lag], axis=0)
    return np.maximum(alone, neighbours) * _widening(shares)


def _widening(shares: Array) -> Array:
    """Return the factor on each variance, by the rows' shares in the numbers, (n, k), since few rows give it."""
    squares = np.sum(shares**2, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        freedom = 2.0 * squares**2 / np.sum(shares**4, axis=0)
    freedom = np.where(np.isfinite(freedom), freedom, math.inf)
    return (stdtrit(freedom, WITHIN) / ndtri(WITHIN)) ** 2


def uncertainty(problem: FitProblem, fitted: Fitted) -> Uncertainty:
    """Return how well the records of a bench determine a fitted hypothesis.

    Raises:
        ValueError: the hypothesis cannot be simulated.
    """
    readings = problem.readings(fitted.hypothesis)
    if readings is None:
        raise ValueError("the fitted hypothesis cannot be simulated")
    left = [
        (x.measured_um - fitted.calibration.gain * y - offset)[x.training]
        for x, y, offset in zip(problem.observations, readings, fitted.calibration.offsets_um, strict=True)
    ]
    share = problem.all_rows / max(independent_rows(problem, fitted), 1.0)
    together = np.concatenate(left)
    variance = float(np.mean(together**2)) * share
    slopes = columns(problem, fitted, readings, [x.training for x in problem.observations])
    inverse = _covariance(slopes)
    # what the records do not determine stays open, however little is left of them
    covariance = np.where(np.isfinite(inverse), variance * np.where(np.isfinite(inverse), inverse, 0.0), inverse)
    with np.errstate(divide="ignore", invalid="ignore"):
        wider = np.sqrt(np.nan_to_num(sandwich(slopes, inverse, together) / np.diag(covariance), posinf=1.0))
    wider = np.maximum(wider, 1.0)
    covariance *= np.outer(wider, wider)
    count = fitted.hypothesis.free_count
    cell = cell_of(problem, fitted)
    if cell is not None:
        k = cell.number
        within = cell.variance(fitted.hypothesis.values()[k])
        if is_undetermined(problem, fitted, cell, variance):
            # evenly spread over the cell, and a gain makes up for it
            covariance[k, k] = max(covariance[k, k], within)
            covariance[count, count] = max(covariance[count, count], within * fitted.calibration.gain**2)
        elif covariance[k, k] > within:
            # the slopes in the cell leave more open than the cell does
            part = math.sqrt(within / covariance[k, k])
            covariance[k, k] = 0.0
            covariance[k, :] *= part
            covariance[:, k] = covariance[k, :]
            covariance[k, k] = within
    deviations = np.sqrt(np.diag(covariance))
    offsets = tuple(float(x) for x in deviations[count + 1 :])
    if have_same_zero(problem.observations):
        offsets *= len(problem.observations)
    return Uncertainty(covariance[:count, :count], float(deviations[count]), offsets, covariance[:count, count])
