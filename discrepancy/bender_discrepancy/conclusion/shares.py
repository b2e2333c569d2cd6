"""Which part of the gap each effect of a hypothesis closes, so that the parts add up to what they close together.

What an effect closes depends on which others are in the model already. Its share is the mean over all orders of adding
(Shapley 1953; for the variance that regressors explain: Lindeman, Merenda and Gold 1980). Every subset of the effects
is stood for by the fit of it, or of a part of it, that leaves least.
"""

from itertools import combinations
from math import factorial

import numpy as np

from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.search.archive import Archive, left_square


def held_square_um2(fitted: Fitted, problem: FitProblem) -> float:
    """Return the mean square on the held-out rows that count now: readings may have been set aside since the fit."""
    left = [r[x.reporting] for r, x in zip(fitted.residuals, problem.observations, strict=True)]
    rows = np.concatenate(left)
    return float(np.mean(rows**2)) if rows.size else 0.0


def shares_of_gap(archive: Archive, base: Fitted, best: Fitted) -> dict[str, float]:
    """Return the share of the variance above the noise floor, on rows that nothing saw, that each effect closes.

    Args:
        archive: what was fitted.
        base: the model as given, recalibrated.
        best: the hypothesis that has the effects.
    """
    effects = best.hypothesis.effects
    structure = best.hypothesis.structure
    fits = [x for x in archive.fits if x.hypothesis.structure is structure and set(x.hypothesis.effects) <= {*effects}]
    floor = archive.noise_um**2
    gap = held_square_um2(base, archive.problem) - floor
    if gap <= 0.0:
        return dict.fromkeys(effects, 0.0)

    def closed(subset: frozenset[str]) -> float:
        if not subset:
            return 0.0
        if subset == frozenset(effects):
            fitted = best
        else:
            within = (x for x in fits if subset.issuperset(x.hypothesis.effects))
            fitted = min(within, key=left_square, default=base)
        return 1.0 - (max(held_square_um2(fitted, archive.problem), floor) - floor) / gap

    known = {
        frozenset(x): closed(frozenset(x)) for size in range(len(effects) + 1) for x in combinations(effects, size)
    }
    return {x: min(max(_mean_over_orders(x, effects, known), 0.0), 1.0) for x in effects}


def _mean_over_orders(effect: str, effects: tuple[str, ...], closed: dict[frozenset[str], float]) -> float:
    others, count = [x for x in effects if x != effect], len(effects)
    share = 0.0
    for size in range(count):
        weight = factorial(size) * factorial(count - size - 1) / factorial(count)
        for before in combinations(others, size):
            share += weight * (closed[frozenset((*before, effect))] - closed[frozenset(before)])
    return share
