"""Sparse supports by PySINDy's STLSQ and FROLS, and how often each term survives a resampling of the data."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_identify.regression.rates import Regression
from bender_identify.settings import THRESHOLDS

Array = NDArray[np.float64]
Support = tuple[int, ...]

RIDGE = 0.05
LIKELY = 0.5
DEPENDENT = 1e-8
"""Part of a column that rounding may leave of one that others add up to."""


@dataclass(frozen=True, slots=True, eq=False)
class Ensemble:
    """Bootstrap of the regression at one threshold.

    Attributes:
        inclusion: (k,) share of the resamples in which each term of the library survives.
        median: (k,) coefficients in um, V and s, of the resamples in which it does.
        spread: (k,) half the range that holds the middle 68 % of them.
    """

    inclusion: Array
    median: Array
    spread: Array


def supports(regression: Regression) -> list[Support]:
    """Return the distinct sets of terms that the optimiser keeps, over its thresholds, sparsest first."""
    kept = (np.flatnonzero(_coefficients(x, regression.library, regression.rates)) for x in THRESHOLDS)
    found = {tuple(int(k) for k in support) for support in kept if support.size}
    return sorted(found, key=lambda s: (len(s), s))


def greedy_supports(regression: Regression) -> list[Support]:
    """Return the sets of terms along the path of forward orthogonal least squares, the sparsest first.

    A column that the ones before it add up to is not offered: nothing of it is left beside them.
    """
    import pysindy

    offered = _independent(regression.library)
    if not offered:
        return []
    optimiser: Any = pysindy.FROLS(alpha=RIDGE, kappa=0.0)
    _fit(optimiser, regression.library[:, offered], regression.rates)
    steps = (np.flatnonzero(np.asarray(step)) for step in (*optimiser.history_, optimiser.coef_))
    found = {tuple(offered[int(k)] for k in support) for support in steps if support.size}
    return sorted(found, key=lambda s: (len(s), s))


def _independent(columns: Array) -> list[int]:
    """Return the columns of which something is left beside those before them."""
    kept: list[int] = []
    directions = np.empty((columns.shape[0], 0))
    for k, column in enumerate(columns.T):
        size = float(np.linalg.norm(column))
        left = column
        # twice: what rounding leaves of the first time would count as a direction
        for _ in range(2):
            left = left - directions @ (directions.T @ left)
        if np.linalg.norm(left) > DEPENDENT * size:
            kept.append(k)
            directions = np.column_stack([directions, left / np.linalg.norm(left)])
    return kept


def least_squares(regression: Regression, support: Support) -> Array:
    """Return the coefficients of a support, in um, V and s."""
    columns = regression.library[:, support]
    solution = np.linalg.lstsq(columns, regression.rates, rcond=None)[0]
    return solution * regression.scales[list(support)]


def ensemble_of(regression: Regression, count: int, threshold: float, rng: np.random.Generator) -> Ensemble:
    """Refit on resampled blocks of rows with one term left out of the library each time (Fasel et al. 2022)."""
    k = len(regression.terms)
    kept = np.zeros((count, k))
    offered = np.zeros((count, k), dtype=bool)
    for draw in range(count):
        rows = _block_rows(len(regression.rates), regression.block_rows, rng)
        columns = np.delete(np.arange(k), rng.integers(k)) if k > 2 else np.arange(k)
        kept[draw, columns] = _coefficients(
            threshold, regression.library[np.ix_(rows, columns)], regression.rates[rows]
        )
        offered[draw, columns] = True
    survived = kept != 0.0
    inclusion = survived.sum(axis=0) / np.maximum(offered.sum(axis=0), 1)
    quantiles = np.array(
        [np.quantile(kept[survived[:, j], j], (0.16, 0.5, 0.84)) if survived[:, j].any() else np.zeros(3)
         for j in range(k)]
    )  # fmt: skip
    spread = 0.5 * (quantiles[:, 2] - quantiles[:, 0])
    return Ensemble(inclusion, quantiles[:, 1] * regression.scales, spread * np.abs(regression.scales))


def likely(ensemble: Ensemble) -> Support:
    """Return the terms that survive in at least half of the resamples."""
    return tuple(int(k) for k in np.flatnonzero(ensemble.inclusion >= LIKELY))


def _block_rows(count: int, block: int, rng: np.random.Generator) -> NDArray[np.intp]:
    block = min(block, count)
    starts = rng.integers(0, count - block + 1, size=-(-count // block))
    return (starts[:, None] + np.arange(block)).ravel()[:count]


def _coefficients(threshold: float, columns: Array, rates: Array) -> Array:
    """Return the coefficients (k,) of sequentially thresholded least squares."""
    import pysindy

    optimiser = pysindy.STLSQ(threshold=threshold, alpha=RIDGE)
    _fit(optimiser, columns, rates)
    return np.asarray(optimiser.coef_, dtype=np.float64).reshape(-1)


def _fit(optimiser: Any, columns: Array, rates: Array) -> None:
    # its warnings (nothing left, ill-conditioned) are found again, and told, by the re-simulation
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        optimiser.fit(columns, rates[:, None])
