"""Units that are alike: k-means over gain, lag and delay of their loops, each on a logarithmic, robust scale."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bender_fleet.tuning.plants import UnitPlant

_LEAST_SPREAD = 0.02
"""Quantities that differ by less than two per cent are the same for a controller."""


def grouped(
    plants: Sequence[UnitPlant], seen: NDArray[np.bool_], count: int, rng: np.random.Generator
) -> NDArray[np.intp]:
    """Return the group of every unit, (n,), numbered from 0 in the order of their gains; there may be fewer than asked.

    Args:
        plants: the units.
        seen: (n,) which of them make the groups; each of the others joins the nearest one.
        count: how many groups.
        rng: of the first centres.
    """
    from scipy.cluster.vq import kmeans2

    if count == 1:
        return np.zeros(len(plants), dtype=np.intp)
    raw = np.array([_numbers(x) for x in plants])
    spread = np.median(np.abs(raw[seen] - np.median(raw[seen], axis=0)), axis=0)
    scaled = raw / np.maximum(spread, _LEAST_SPREAD)
    known = scaled[seen]
    centres = known
    if len(known) > count:
        found, labels = kmeans2(known, count, minit="++", rng=rng)
        centres = found[np.unique(labels)]
    centres = centres[np.argsort(centres[:, 0], kind="stable")]
    # a centre that lost its units to its neighbours is none
    centres = centres[np.unique(_nearest(known, centres))]
    return _nearest(scaled, centres)


def _nearest(points: NDArray[np.float64], centres: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the nearest of the centres, (k, 3), for every point, (n, 3)."""
    return np.argmin(np.sum((points[:, None, :] - centres[None, :, :]) ** 2, axis=2), axis=1).astype(np.intp)


def _numbers(x: UnitPlant) -> tuple[float, float, float]:
    period_s = x.linearisation.model.period_s
    lag_s, delay_s = x.reduced.lag_s, x.reduced.delay_s
    return float(np.log(x.reduced.gain_um_per_V)), float(np.log(lag_s + period_s)), float(np.log(delay_s + period_s))
