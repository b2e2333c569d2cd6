"""Several more effects at once, where none of them is certain before all the others are there.

One at a time, an effect has to take most of the residual. Of four or five that are missing, each may take less than
half. Here effects are added without any being certain; what comes of it counts only if it leaves noise alone, and if
each of its effects then stands as any other has to.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

from bender_discrepancy.effects.form import Form
from bender_discrepancy.fitting.criterion import STARTS_OF_A_FORM, cost, yardstick
from bender_discrepancy.fitting.output_error import Fitted, recounted
from bender_discrepancy.search.budget import BUDGET
from bender_discrepancy.search.evidence import (
    Evidence,
    closed_share,
    is_finished,
    removes_most,
    total_square,
)
from bender_discrepancy.search.revise import looked_back
from bender_discrepancy.search.set_aside import cleared, settled
from bender_discrepancy.search.state import Found, Ranked, rms_um, work_so_far
from bender_discrepancy.search.step import tried_on

Tell = Callable[[str], None]


def several_are_missing(found: Found, by: Evidence, *, stands: bool) -> bool:
    """Return whether what a search tried shows that several more effects are missing, all of the catalogue.

    Where nothing that was tried closes most of the gap, they are not in the catalogue. Where what was found stands, the
    rest may as well be what its forms leave, unless what was tried beside it removes most of that.

    Args:
        found: by the search.
        by: the constants.
        stands: whether what was found would be named.
    """
    nearest = _nearest(found)
    if closed_share(found, nearest) < by.closes:
        return False
    return not stands or removes_most(found.best, nearest, found, by)


def together(
    found: Found, forms: Sequence[Form], most: int, by: Evidence, tell: Tell, *, while_most: bool = False
) -> Found | None:
    """Return the best hypothesis of a few more effects, with those that it was chosen from; None where none comes near.

    Args:
        found: by a search that ended with structure left.
        forms: of the effects.
        most: effects in one hypothesis.
        by: the constants.
        tell: is told what is being done.
        while_most: go on only where an effect more removes most of what all the others leave.
    """
    beam = _leaders([*(x.fitted for x in found.last_ranking), *(x.fitted for x in found.ranking)], found)
    before, limit = 0.0, (1.0 + BUDGET.together) * BUDGET.work_for(found.problem.all_rows)
    while beam := [x for x in beam if len(x.hypothesis.parts) < most]:
        now = work_so_far(found.problem)
        if now + BUDGET.work_growth * before > limit:
            return None
        depth = 1 + max(len(x.hypothesis.parts) for x in beam)
        tell(f"step {depth}: trying {len(forms)} forms on {len(beam)} models, none of them certain")
        nearest = _nearest(found)
        found = _one_more(found, beam, forms, by)
        if is_finished(found.best, found, by):
            return found
        if while_most and not removes_most(nearest, _nearest(found), found, by):
            return None
        beam = _leaders([x.fitted for x in found.last_ranking], found)
        before = work_so_far(found.problem) - now
    return found if rms_um(found.best, found.problem) < BUDGET.near * found.noise_um else None


def _one_more(found: Found, beam: Sequence[Fitted], forms: Sequence[Form], by: Evidence) -> Found:
    """Return what was found with one more effect on each model of a beam, ranked, the best one in the place of all."""
    tried: list[Fitted] = []
    for parent in beam:
        tried += tried_on(found, parent, forms, tried)
    if not tried:
        return replace(found, last_ranking=())
    leader = min(tried, key=lambda x: x.training_square)
    if len(leader.hypothesis.parts) > 1:
        tried.append(looked_back(found.problem, leader, forms, found.noise_um))
        leader = min(tried, key=lambda x: x.training_square)
    found, tried, leader = cleared(found, tried, leader)
    weighed_by = yardstick(found.problem, leader, STARTS_OF_A_FORM * len(forms), by.confidence)
    before = cost(found.base, weighed_by)
    ranked = sorted((Ranked(x, cost(x, weighed_by) - before) for x in tried), key=lambda x: x.difference)
    best = ranked[0].fitted
    found = settled(replace(found, best=best, steps=(found.base, best), yardstick=weighed_by))
    again = (replace(x, fitted=recounted(x.fitted, found.problem)) for x in ranked)
    led = found.led | {x.fitted.hypothesis.effects[-1] for x in ranked}
    return replace(found, last_ranking=tuple(again), led=led)


def _nearest(found: Found) -> Fitted:
    """Return what leaves least of all that the last step and the first one tried."""
    tried = (found.best, *(x.fitted for x in (*found.last_ranking, *found.ranking)))
    return min(tried, key=total_square)


def _leaders(tried: Sequence[Fitted], found: Found) -> list[Fitted]:
    """Return the best hypotheses of different effects."""
    leaders: dict[frozenset[str], Fitted] = {}
    for x in sorted(tried, key=lambda x: cost(x, found.yardstick)):
        leaders.setdefault(frozenset(x.hypothesis.effects), x)
    return list(leaders.values())[: BUDGET.beam]
