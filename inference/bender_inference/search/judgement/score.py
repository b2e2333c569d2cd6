"""How far one hypothesis predicts readings better than another: a paired test on held-out blocks.

Every reading is predicted by a fit to the other blocks (`fitting.blocked`). Of two hypotheses the difference of the
squared errors is summed over stretches that are long beside its correlation, and its mean is held against its standard
error over stretches (Diebold and Mariano 1995, doi:10.1080/07350015.1995.10524599; batch means, Schmeiser 1982,
doi:10.1287/opre.30.3.556). A block in which both predict badly makes that error as large as the difference, so
the logarithms of whole blocks are tested as well. What shows in few places is as telling as what shows everywhere
where errors are Gaussian: the likelihood ratio of as many independent ones as their correlation leaves counts too. Of
the three, the one that is most favourable to the first hypothesis decides.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri, stdtr

from bender_inference.fitting.criterion import autocorrelation_time
from bender_inference.records.observations import Array, Mask

CORRELATION_TIMES = 3.0
"""Stretches are so many times as long as the differences are correlated."""
FEWEST_STRETCHES = 8
LEAST_PROBABILITY = 1e-300


@dataclass(frozen=True, slots=True)
class Difference:
    """By how much a hypothesis predicts better than another one.

    Attributes:
        deviations: the mean difference in standard errors, as a standard normal deviate; negative where it is worse.
        ratio: mean squared error of the other one over that of this one.
    """

    deviations: float
    ratio: float


def difference(better: Sequence[Array], worse: Sequence[Array], counted: Sequence[Mask]) -> Difference:
    """Return by how much the first hypothesis predicts better.

    Args:
        better: (n,) prediction errors of the first hypothesis, of every record.
        worse: (n,) those of the second one.
        counted: (n,) of every record, the rows that count.
    """
    gains = [np.where(m, b**2 - a**2, 0.0) for a, b, m in zip(better, worse, counted, strict=True)]
    own = sum(float(np.sum(a[m] ** 2)) for a, m in zip(better, counted, strict=True))
    other = sum(float(np.sum(b[m] ** 2)) for b, m in zip(worse, counted, strict=True))
    rows = sum(int(m.sum()) for m in counted)
    time = max((autocorrelation_time(g, m) for g, m in zip(gains, counted, strict=True) if m.any()), default=1.0)
    length = max(1, min(math.ceil(CORRELATION_TIMES * time), rows // FEWEST_STRETCHES))
    sums = np.concatenate([_stretch_sums(g[m], length) for g, m in zip(gains, counted, strict=True)])
    ratio = other / own if own > 0.0 else (math.inf if other > 0.0 else 1.0)
    return Difference(normal_deviate(sums), ratio)


def log_deviate(better: Array, worse: Array) -> float:
    """Return the deviate of the logarithms of blocks' squared errors (b,), of the first hypothesis below the second."""
    return normal_deviate(np.log(np.maximum(worse, 1e-300) / np.maximum(better, 1e-300)))


def likelihood_deviate(better: Sequence[Array], worse: Sequence[Array], counted: Sequence[Mask]) -> float:
    """Return the deviate of the likelihood ratio, the errors of the better one taken as Gaussian noise.

    They count as so many independent ones as their correlation leaves, and every record has a noise of its own;
    arguments as of `difference`.
    """
    ratio = 0.0
    for a, b, m in zip(better, worse, counted, strict=True):
        if m.any():
            own, other = (max(float(np.sum(x[m] ** 2)), 1e-300) for x in (a, b))
            ratio += float(m.sum()) / autocorrelation_time(a, m) * math.log(other / own)
    return math.copysign(math.sqrt(abs(ratio)), ratio)


def normal_deviate(gains: Array) -> float:
    """Return the mean of some gains (k,) in its standard errors, as the standard normal deviate that is as unlikely."""
    spread = float(np.std(gains, ddof=1)) if gains.size > 1 else 0.0
    mean = float(np.mean(gains)) if gains.size else 0.0
    if spread == 0.0:
        return 0.0 if mean == 0.0 or gains.size < 2 else math.copysign(-float(ndtri(LEAST_PROBABILITY)), mean)
    student = mean / spread * math.sqrt(gains.size)
    beyond = max(float(stdtr(gains.size - 1, -abs(student))), LEAST_PROBABILITY)
    return math.copysign(-float(ndtri(beyond)), student)


def _stretch_sums(values: Array, length: int) -> Array:
    """Return the sums of consecutive stretches of so many values; the rest belongs to the last one."""
    whole = values.size // length
    if whole < 1:
        return np.array([values.sum()])
    sums = values[: whole * length].reshape(whole, length).sum(axis=1)
    sums[-1] += float(values[whole * length :].sum())
    return sums
