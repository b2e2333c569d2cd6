"""Units that are alike: k-means over gain, lag and delay of their loops, each on a logarithmic, robust scale."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bender_fleet.tuning.plants import UnitPlant

_LEAST_SPREAD = 0.02
"""Quantities that differ by less than two per cent are the same for a controller."""


def grouped(plants: Sequence[UnitPlant], count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Return the group of every unit, (n,), numbered from 0 in the order of their gains; groups may be empty.

    Args:
        plants: the units.
        count: how many groups.
        rng: of the first centres.
    """
    from scipy.cluster.vq import kmeans2

    if count == 1 or len(plants) <= count:
        return np.zeros(len(plants), dtype=np.intp) if count == 1 else np.arange(len(plants))
    raw = np.array([_numbers(x) for x in plants])
    spread = np.median(np.abs(raw - np.median(raw, axis=0)), axis=0)
    centres, labels = kmeans2(raw / np.maximum(spread, _LEAST_SPREAD), count, minit="++", rng=rng)
    order = np.argsort(centres[:, 0])
    place = np.empty(count, dtype=np.intp)
    place[order] = np.arange(count)
    return place[labels]


def _numbers(x: UnitPlant) -> tuple[float, float, float]:
    period_s = x.linearisation.model.period_s
    lag_s, delay_s = x.reduced.lag_s, x.reduced.delay_s
    return float(np.log(x.reduced.gain_um_per_V)), float(np.log(lag_s + period_s)), float(np.log(delay_s + period_s))
