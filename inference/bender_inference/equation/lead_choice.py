"""Which sparse equation: candidates of PySINDy run freely, shortened, compared on rows that their fit did not see."""

from collections.abc import Sequence

import numpy as np

from bender_inference.equation.lead_fit import Equation, Ground, fitted_at_once, fitted_in_time, misfit
from bender_inference.equation.lead_supports import at_once_supports, weak_supports
from bender_inference.records.observations import Array, Mask

Support = tuple[int, ...]

# sets of terms of each length that are fitted in time: those whose free run starts nearest
MOST_OF_A_LENGTH = 3
# of the regression
TURNS = 2
# a shorter equation is taken where it explains less by no more than this
SHORTER = 0.01


def choose_equation(ground: Ground) -> Equation | None:
    """Return the shortest equation of those that explain most on the choosing rows, fitted to all of the fit."""
    training, choosing = ground.mask(lambda x: x.training), ground.mask(lambda x: x.choosing)
    rows, judged = training & ~choosing, training & choosing
    if min(int(rows.sum()), int(judged.sum())) < ground.free.shape[1] + 1:
        return None
    found = [fitted_at_once(ground, x, rows) for x in sorted(at_once_supports(ground.tracks, ground.at_once))]
    beside = np.zeros_like(ground.left_um)
    for _ in range(TURNS):
        found += _in_time(ground, beside, rows)
        # terms are found more purely where it is known what gain and offsets add
        beside = max(found, key=lambda x: ground.share(x, rows)).beside_um if found else beside
    scored = [(ground.share(x, judged), x) for x in found]
    if not scored:
        return None
    best = max(share for share, _ in scored)
    share, first = min((x for x in scored if x[0] >= best - SHORTER), key=_brevity)
    first = _shortened(ground, first, share, rows, judged)
    return _again(ground, first.support, first, training)


def _brevity(scored: tuple[float, Equation]) -> tuple[int, bool, float]:
    share, x = scored
    return len(x.terms), x.per_second, -share


def _in_time(ground: Ground, beside_um: Array, rows: Mask) -> list[Equation]:
    """Return equations for dr/dt, of every length those that promise most."""
    ranked: dict[int, list[tuple[float, Support, list[Array]]]] = {}
    for support, starts in sorted(weak_supports(ground.tracks, ground.split(beside_um)).items()):
        least = min(misfit(ground, support, x, rows) for x in starts)
        ranked.setdefault(len(support), []).append((least, support, starts))
    found: list[Equation | None] = []
    for alike in ranked.values():
        for _, support, starts in sorted(alike, key=lambda x: x[:2])[:MOST_OF_A_LENGTH]:
            found.append(fitted_in_time(ground, support, starts, rows))
    return [x for x in found if x is not None]


def _shortened(ground: Ground, first: Equation, share: float, rows: Mask, judged: Mask) -> Equation:
    """Take terms out as long as what is explained stays."""
    least = share - SHORTER
    while len(first.terms) > 1:
        tried = [_again(ground, _without(first.support, k), first, rows) for k in range(len(first.terms))]
        scored = [(ground.share(x, judged), x) for x in tried if x is not None]
        best = max(scored, key=lambda x: x[0], default=None)
        if best is None or best[0] < least:
            return first
        first = best[1]
    return first


def _again(ground: Ground, support: Support, before: Equation, rows: Mask) -> Equation | None:
    """Fit these terms of an equation to other rows."""
    if not before.per_second:
        return fitted_at_once(ground, support, rows)
    start = [value for k, value in zip(before.support, before.coefficients, strict=True) if k in support]
    return fitted_in_time(ground, support, [np.array(start)], rows)


def _without(support: Sequence[int], index: int) -> Support:
    return (*support[:index], *support[index + 1 :])
