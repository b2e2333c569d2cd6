"""Which part of the gap each effect of a hypothesis closes, so that the parts add up to what they close together.

There is one meaning of a part of the gap: 1 - (left^2 - floor^2) / (gap^2 - floor^2), with the rms of the residual on
the reported rows that calibration alone leaves (gap) and that a model leaves (left), steps of the readings included,
and the noise floor, which has these steps in it.

What an effect closes depends on which others are in the model already. Its share is the mean over all orders of adding
(Shapley 1953; for the variance that regressors explain: Lindeman, Merenda and Gold 1980). Every subset of the effects
is stood for by the fit of it, or of a part of it, that leaves least; one that is no better than nothing on the reported
rows closes nothing, however much worse it is. The model's own numbers, where they were freed, have a share like an
effect; an equation without a name has what it closes after all of them.
"""

from collections.abc import Mapping
from itertools import combinations
from math import factorial

from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import Fitted
from bender_inference.search.archive import Archive, left_square
from bender_inference.search.noise import floor_square_um2, square_on

OWN_NUMBERS, EQUATION = "own numbers", "equation"
"""What has a share beside the effects."""


def held_square_um2(fitted: Fitted, problem: FitProblem) -> float:
    """Return the mean square on the held-out rows that count now: readings may have been set aside since the fit."""
    return square_on(problem, fitted, [x.reporting for x in problem.observations])


def closed_by(archive: Archive, base: Fitted, fitted: Fitted) -> float:
    """Return the part of the gap that a fit closes on rows that nothing saw, at most 1; negative where it is worse."""
    floor = floor_square_um2(archive.problem, archive.noise_um)
    gap = held_square_um2(base, archive.problem) - floor
    return 1.0 - max(held_square_um2(fitted, archive.problem) - floor, 0.0) / gap if gap > 0.0 else 0.0


def shares_of_gap(archive: Archive, base: Fitted, best: Fitted) -> dict[str, float]:
    """Return the share of the gap that each effect closes, and what else of the hypothesis does.

    Args:
        archive: what was fitted.
        base: the model as given, recalibrated.
        best: the hypothesis that has the effects.
    """
    hypothesis = best.hypothesis
    players = _players(hypothesis)
    fits = [
        x
        for x in archive.fits
        if x.hypothesis.structure is hypothesis.structure
        and x.hypothesis.equation is None
        and {*_players(x.hypothesis)} <= {*players}
    ]

    def closed(subset: frozenset[str]) -> float:
        if not subset:
            return 0.0
        if subset == frozenset(players) and hypothesis.equation is None:
            return closed_by(archive, base, best)
        within = (x for x in fits if subset.issuperset(_players(x.hypothesis)))
        return max(closed_by(archive, base, min(within, key=left_square, default=base)), 0.0)

    known = {
        frozenset(x): closed(frozenset(x)) for size in range(len(players) + 1) for x in combinations(players, size)
    }
    shares = {x: _mean_over_orders(x, players, known) for x in players}
    together = closed_by(archive, base, best)
    if hypothesis.equation is not None:
        shares[EQUATION] = together - known[frozenset(players)]
    return split(together, shares)


def split(closed: float, shares: Mapping[str, float]) -> dict[str, float]:
    """Return shares in the same proportions that add up to what is closed; what closes nothing has none of it."""
    positive = {x: max(share, 0.0) for x, share in shares.items()}
    total = sum(positive.values())
    if not closed > 0.0:
        return dict.fromkeys(shares, 0.0)
    if total == 0.0:
        return dict.fromkeys(shares, min(closed, 1.0) / max(len(shares), 1))
    return {x: min(closed, 1.0) * (share / total) for x, share in positive.items()}


def _players(hypothesis: Hypothesis) -> tuple[str, ...]:
    own = () if hypothesis.own is None else (OWN_NUMBERS,)
    return (*hypothesis.effects, *own)


def _mean_over_orders(player: str, players: tuple[str, ...], closed: Mapping[frozenset[str], float]) -> float:
    others, count = [x for x in players if x != player], len(players)
    share = 0.0
    for size in range(count):
        weight = factorial(size) * factorial(count - size - 1) / factorial(count)
        for before in combinations(others, size):
            share += weight * (closed[frozenset((*before, player))] - closed[frozenset(before)])
    return share
