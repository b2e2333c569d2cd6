"""How well the probabilities of effects are kept, and the weights that judged effects teach."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize

BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
RIDGE = 1e-2
COLUMNS = ("told", "effects", "mean", "there")


@dataclass(frozen=True, slots=True)
class JudgedEffect:
    """One effect that an answer had in its model.

    Attributes:
        parts: of the case against it.
        is_there: whether it was hidden.
    """

    parts: tuple[float, ...]
    is_there: bool


def weights(told: Sequence[JudgedEffect]) -> tuple[float, ...]:
    """Return the weights of a logistic curve that fit best (maximum likelihood with a slight ridge)."""
    parts = np.array([x.parts for x in told])
    signs = np.array([1.0 if x.is_there else -1.0 for x in told])

    def loss(w: np.ndarray) -> float:
        return float(np.sum(np.logaddexp(0.0, -signs * (parts @ w)))) + RIDGE * float(w @ w)

    start = np.zeros(parts.shape[1])
    # more evidence never speaks against an effect
    bounds = [(None, None), *[(0.0, None)] * (parts.shape[1] - 1)]
    return tuple(round(float(x), 3) for x in minimize(loss, start, bounds=bounds).x)


def by(told: Sequence[JudgedEffect], weighed: Sequence[float]) -> list[tuple[float, bool]]:
    """Return the probability that some weights give every effect, and whether it is there."""
    if not told:
        return []
    evidence = np.array([x.parts for x in told]) @ np.array(weighed)
    return [(float(p), x.is_there) for p, x in zip(1.0 / (1.0 + np.exp(-evidence)), told, strict=True)]


def reliability(pairs: Sequence[tuple[float, bool]]) -> list[list[str]]:
    """Return for every bin of probabilities: how many effects, their mean probability, the share that is there."""
    found: list[list[str]] = []
    for low, high in pairwise(BINS):
        own = [(p, there) for p, there in pairs if low <= p < high or (p == high == 1.0)]
        if own:
            mean, share = (float(np.mean([x[k] for x in own])) for k in (0, 1))
            found.append([f"{low:.1f} to {high:.1f}", str(len(own)), f"{mean:.3f}", f"{share:.3f}"])
    return found


def calibration_error(pairs: Sequence[tuple[float, bool]]) -> float:
    """Return the expected calibration error: what bins are off by, weighed by how many effects they hold."""
    total = 0.0
    for low, high in pairwise(BINS):
        own = np.array([x for x in pairs if low <= x[0] < high or (x[0] == high == 1.0)], dtype=np.float64)
        if own.size:
            total += len(own) * abs(float(own[:, 0].mean() - own[:, 1].mean()))
    return total / max(len(pairs), 1)
