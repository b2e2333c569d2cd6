"""Sparse supports by PySINDy's optimisers, and how often each term survives a resampling of the data."""

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_identify.regression.rates import Regression
from bender_identify.settings import THRESHOLDS, Settings

Array = NDArray[np.float64]
Support = tuple[int, ...]

RIDGE = 0.05
LIKELY = 0.5


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


def supports(regression: Regression, settings: Settings) -> list[Support]:
    """Return the distinct sets of terms that the optimiser keeps, over its thresholds, sparsest first."""
    found: set[Support] = set()
    for threshold in (settings.threshold,) if settings.threshold is not None else THRESHOLDS:
        for coefficients in _path(settings.optimiser, threshold, regression.library, regression.rates):
            support = tuple(int(k) for k in np.flatnonzero(coefficients))
            if support:
                found.add(support)
    return sorted(found, key=lambda s: (len(s), s))


def least_squares(regression: Regression, support: Support) -> Array:
    """Return the coefficients of a support, in um, V and s."""
    columns = regression.library[:, support]
    solution = np.linalg.lstsq(columns, regression.rates, rcond=None)[0]
    return solution * regression.scales[list(support)]


def ensemble_of(regression: Regression, settings: Settings, threshold: float, rng: np.random.Generator) -> Ensemble:
    """Refit on resampled blocks of rows with one term left out of the library each time (Fasel et al. 2022)."""
    count, k = settings.ensemble, len(regression.terms)
    kept = np.zeros((count, k))
    offered = np.zeros((count, k), dtype=bool)
    for draw in range(count):
        rows = _block_rows(len(regression.rates), regression.block_rows, rng)
        columns = np.delete(np.arange(k), rng.integers(k)) if k > 2 else np.arange(k)
        *_, coefficients = _path(
            settings.optimiser, threshold, regression.library[np.ix_(rows, columns)], regression.rates[rows]
        )
        kept[draw, columns] = coefficients
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


def _path(name: str, threshold: float, columns: Array, rates: Array) -> Iterator[Array]:
    """Yield the coefficients of an optimiser: along its path where it has one, the final ones last."""
    optimiser = _optimiser(name, threshold)
    # its warnings (nothing left, ill-conditioned) are found again, and told, by the re-simulation
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        optimiser.fit(columns, rates[:, None])
    if name in ("ssr", "frols"):
        yield from (np.asarray(step).reshape(-1) for step in _history(optimiser))
    yield np.asarray(optimiser.coef_).reshape(-1)


def _history(optimiser: Any) -> Sequence[Any]:
    return getattr(optimiser, "history_", [])


def _optimiser(name: str, threshold: float) -> Any:
    import pysindy

    if name == "stlsq":
        return pysindy.STLSQ(threshold=threshold, alpha=RIDGE)
    if name == "sr3":
        return pysindy.SR3(reg_weight_lam=0.5 * threshold * threshold, relax_coeff_nu=1.0, max_iter=300, unbias=True)
    if name == "ssr":
        return pysindy.SSR(alpha=RIDGE, kappa=threshold * threshold)
    return pysindy.FROLS(alpha=RIDGE, kappa=threshold * threshold)
