"""Which of the leading hypotheses is carried best to where its fit has not been.

To predict a block from those around it is to interpolate. What a model is used for lies elsewhere: later, and at larger
amplitudes. So where structure is left, the finalists are fitted again without the last stretch of the records and
without the blocks of the largest commands, and judged there as well (Snee 1977, doi:10.1080/00401706.1977.10489581).
"""

from dataclasses import replace

import numpy as np

from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.output_error import Fitted, fit, judge
from bender_inference.records.observations import Mask, Observations
from bender_inference.records.roles import BLOCKS, blocks_of
from bender_inference.search.archive import Archive
from bender_inference.search.budget import BUDGET
from bender_inference.search.judgement.rules import Rules

LAST, LARGEST = 2, 3
"""Blocks of twenty at the end of a record, and of the largest commands."""


def best_carried(archive: Archive, rules: Rules, best: Fitted) -> Fitted:
    """Return the hypothesis, or the finalist that predicts clearly better where neither was fitted.

    A finalist is as simple, and predicts blocks as well as the hypothesis does, but for chance. A hypothesis that is
    worse there than no effect at all is carried nowhere: of those that are as simple, whatever predicts all rows best
    that it was not fitted to takes its place.
    """
    square, bare = transfer_square(archive.problem, best), archive.bare(best.hypothesis.structure) or archive.fits[0]
    most = rules.complexity(archive, best)
    if best.hypothesis.parts and square > transfer_square(archive.problem, bare):
        leaders = [x for x in (bare, *_leaders(archive, rules, most)) if x.hypothesis.keeps_shown_of(best.hypothesis)]
        leaders = leaders or [best]
        return min(leaders, key=lambda x: archive.square(x) + transfer_square(archive.problem, x))
    finalists = [best]
    for x in (y for y in archive.by_fit() if y.hypothesis.keeps_shown_of(best.hypothesis)):
        if len(finalists) > BUDGET.finalists:
            break
        if rules.complexity(archive, x) > most:
            continue
        is_new = all(x.hypothesis.effects != y.hypothesis.effects for y in finalists)
        if is_new and rules.is_in_range(archive, x) and not rules.gains(archive, best, x):
            finalists.append(x)
    squares = [square, *(transfer_square(archive.problem, x) for x in finalists[1:])]
    least = int(np.argmin(squares))
    return finalists[least] if squares[least] < (1.0 - rules.inadequacy) * squares[0] else best


def _leaders(archive: Archive, rules: Rules, most: int) -> list[Fitted]:
    """Return the hypotheses of no more numbers that leave least, the best one of each set of forms."""
    found: dict[tuple[str, ...], Fitted] = {}
    for x in archive.by_fit():
        forms = tuple(sorted(part.form.name for part in x.hypothesis.parts))
        if forms not in found and rules.complexity(archive, x) <= most and rules.is_in_range(archive, x):
            found[forms] = x
        if len(found) == BUDGET.leaders:
            break
    return list(found.values())


def transfer_square(problem: FitProblem, fitted: Fitted) -> float:
    """Return the mean square on the last and the largest blocks, predicted without them; inf where that cannot be."""
    places = [_extreme(x) for x in problem.observations]
    rows = zip(problem.observations, places, strict=True)
    elsewhere = problem.observing([replace(x, held_out=x.held_out | m) for x, m in rows])
    if any(int(x.training.sum()) <= fitted.hypothesis.free_count + 1 for x in elsewhere.observations):
        return np.inf
    again = fit(elsewhere, fitted.hypothesis, BUDGET.first_evaluations)
    again = judge(elsewhere, again.hypothesis) if again is not None else None
    if again is None:
        return np.inf
    left = [r[m & x.searched] for r, m, x in zip(again.residuals, places, problem.observations, strict=True)]
    return float(np.mean(np.square(np.concatenate(left))))


def _extreme(x: Observations) -> Mask:
    """Return the rows (n,) of the last blocks of a record and of those with the largest commands."""
    blocks = blocks_of(x.usable)
    away = np.abs(x.command_V - np.median(x.command_V))
    size = np.zeros(BLOCKS)
    np.maximum.at(size, blocks, away)
    largest = np.argsort(size, kind="stable")[-LARGEST:]
    return np.isin(blocks, (*range(BLOCKS - LAST, BLOCKS), *largest))
