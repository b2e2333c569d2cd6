"""The effects that a diagnosis reports, each with its hypothesis, its share of the gap and its rivals."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.fitting.criterion import cost, very_strong
from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.output_error import Fitted, fit, recounted
from bender_discrepancy.search.certain import OTHER_SIDE
from bender_discrepancy.search.evidence import closed_share, is_with_a_loop
from bender_discrepancy.search.result import SearchResult
from bender_discrepancy.search.state import Ranked
from bender_discrepancy.search.verdict import Rival, one_loop, stand_in, worse_by

# a rival that one frequency at one amplitude cannot rule out closes at least this part of what the best one closes
CLOSES_AS_WELL = 0.8
MOST_RIVALS = 4
# of what explains too little, so many are told that close at least this part
MOST_TOLD, LEAST_TOLD = 3, 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Contender:
    """One effect that is reported.

    Attributes:
        fitted: the hypothesis in which it stands.
        index: its place in that hypothesis.
        share_of_gap: part of the recalibrated residual's variance above the noise floor that is lost without it.
        before_um: rms on held-out rows of the hypothesis without it, fitted again.
        after_um: the same with it.
        without: the criterion's difference to the hypothesis without it.
        rivals: others that were fitted in its place, best first.
        rival_of: the effect whose place it would take, for the rivals of an ambiguous verdict; None otherwise.
    """

    fitted: Fitted
    index: int
    share_of_gap: float
    before_um: float
    after_um: float
    without: float
    rivals: tuple[Rival, ...]
    rival_of: str | None = None

    @property
    def id(self) -> str:
        """The contract's name of the effect."""
        return self.fitted.hypothesis.effects[self.index]


def held_square_um2(fitted: Fitted, bench: FitProblem) -> float:
    """Return the mean square on the held-out rows that count now: readings may have been set aside since the fit."""
    left = [r[x.reporting] for r, x in zip(fitted.residuals, bench.observations, strict=True)]
    return float(np.mean(np.concatenate(left) ** 2))


def leaders(search: SearchResult) -> tuple[Fitted, ...]:
    """Return the hypotheses that the records cannot distinguish, best first; the best alone where they can."""
    best = search.best
    if search.verdict.word != "ambiguous" or search.verdict.commuting:
        return (best,)
    close = {x.id for x in search.verdict.rivals if x.is_close(search.settings.confidence)}
    others = _last_rivals(search)
    if one_loop(search.bench, search.found):
        memories = {_name(best, x) for x in _with_memory(search)}
        return (best, *(x for x in others if _name(best, x) in close | memories))
    chosen = [x for x in others if _name(best, x) in close]
    return (best, *(chosen or _with_memory(search))[:MOST_RIVALS])


def contested(search: SearchResult, leaders: Sequence[Fitted]) -> frozenset[str]:
    """Return the effects of the best hypothesis that the records cannot tell from others: not all leaders have them."""
    best, *others = leaders
    if search.verdict.commuting:
        return frozenset(OTHER_SIDE)
    if not others and one_loop(search.bench, search.found):
        return frozenset(x.form.effect for x in best.hypothesis.parts if x.form.memory)
    shared = set(best.hypothesis.effects).intersection(*(x.hypothesis.effects for x in others)) if others else ()
    return frozenset(x for x in best.hypothesis.effects if x not in shared)


@dataclass(frozen=True, slots=True)
class Alternative:
    """Effects that are not said to be missing, though they would account for the gap in part or as well.

    Attributes:
        effects: by their ids, in the order of adding.
        closes: part of the variance of the gap above the noise floor, over the training and selection blocks.
    """

    effects: tuple[str, ...]
    closes: float


def alternatives(search: SearchResult, verdict: str) -> tuple[Alternative, ...]:
    """Return what came nearest where nothing explains the gap, and what fits as well as the model's own numbers do.

    Of `unexplained` those that the criterion favours, best first; of `recalibrated` the effects that the criterion does
    not tell from other numbers of the model. A named effect and an ambiguous one have their rivals.

    Args:
        search: what was found.
        verdict: the final one.
    """
    found = search.found
    if any(x.size != y.measured_um.size for x, y in zip(found.base.residuals, found.problem.observations, strict=True)):
        return ()
    tried = [x.fitted for x in (*found.last_ranking, *found.ranking) if _is_of(x.fitted, found.base)]
    if verdict == "recalibrated" and found.best.hypothesis.own is not None:
        most = cost(found.best, found.yardstick) + very_strong(search.settings.confidence)
        tried = [x for x in tried if cost(x, found.yardstick) < most]
    elif verdict != "unexplained":
        return ()
    once: dict[frozenset[str], Alternative] = {}
    for x in sorted(tried, key=lambda x: cost(x, found.yardstick)):
        told = Alternative(x.hypothesis.effects, closed_share(found, x))
        once.setdefault(frozenset(told.effects), told)
    worth = [x for x in once.values() if x.effects and x.closes > LEAST_TOLD]
    return tuple(worth)[:MOST_TOLD]


def _is_of(fitted: Fitted, base: Fitted) -> bool:
    """Return whether a hypothesis was fitted to the same rows as another one, without diverging."""
    rows = zip(fitted.residuals, base.residuals, strict=True)
    return math.isfinite(fitted.training_square) and all(x.size == y.size for x, y in rows)


def _last_rivals(search: SearchResult) -> list[Fitted]:
    """Return what was fitted in the place of the last effect, once for each effect, best first."""
    best = set(search.best.hypothesis.effects)
    found: dict[str, Fitted] = {}
    tried = [x.fitted for x in search.found.last_ranking]
    for fitted in sorted(tried, key=lambda x: cost(x, search.found.yardstick)):
        if not best <= set(fitted.hypothesis.effects):
            found.setdefault(_name(search.best, fitted), fitted)
    return list(found.values())


def _with_memory(search: SearchResult) -> list[Fitted]:
    """Return the rivals with a memory that close the gap nearly as well: one sine cannot rule them out."""
    bench = search.bench
    gap = held_square_um2(search.found.base, bench)
    closed = gap - held_square_um2(search.best, bench)
    return [
        x
        for x in _last_rivals(search)
        if x.hypothesis.parts[stand_in(search.best, x)].form.memory
        and gap - held_square_um2(x, bench) > CLOSES_AS_WELL * closed
    ]


def contenders(search: SearchResult) -> list[Contender]:
    """Return the effects to report: those of the best hypothesis in order, then the rivals it cannot be told from."""
    best, *others = leaders(search)
    lacking = _lacking_one(search, best)
    found = [_contender(search, best, k, without, _rivals(search, k)) for k, without in enumerate(lacking)]
    for other in others:
        index, place = stand_in(best, other), _place(best, other)
        rest, known = other.hypothesis.minus(index), lacking[place]
        before = known if rest.effects == known.hypothesis.effects else fit(search.bench, rest) or known
        name = best.hypothesis.effects[place]
        found.append(_contender(search, other, index, before, _against(search, other), name))
    return found


def _contender(
    search: SearchResult,
    fitted: Fitted,
    index: int,
    before: Fitted,
    rivals: tuple[Rival, ...],
    rival_of: str | None = None,
) -> Contender:
    bench, floor = search.bench, search.found.noise_um**2
    gap, rest, left = (held_square_um2(x, bench) for x in (search.found.base, before, fitted))
    above = gap - floor
    share = min(max((rest - max(left, floor)) / above, 0.0), 1.0) if above > 0.0 else 0.0
    by = search.found.yardstick
    without = cost(recounted(before, bench), by) - cost(recounted(fitted, bench), by)
    return Contender(fitted, index, share, rest**0.5, left**0.5, without, rivals, rival_of)


def _lacking_one(search: SearchResult, best: Fitted) -> list[Fitted]:
    """Return, for each effect of a hypothesis, the hypothesis without that effect, fitted again."""
    whole = best.hypothesis
    if len(whole.parts) == 1 and whole.own is None:
        return [search.found.base]
    return [fit(search.bench, whole.minus(k)) or search.found.base for k in range(len(whole.parts))]


def _name(best: Fitted, other: Fitted) -> str:
    """Return the effect of another hypothesis that stands in the place of one of the best."""
    return other.hypothesis.effects[stand_in(best, other)]


def _place(best: Fitted, other: Fitted) -> int:
    """Return which effect of the best hypothesis another one lacks, the last of them."""
    theirs = set(other.hypothesis.effects)
    return max(k for k, x in enumerate(best.hypothesis.effects) if x not in theirs)


def _rivals(search: SearchResult, index: int) -> tuple[Rival, ...]:
    """Return the rivals of one effect of the best hypothesis: what was fitted in its place.

    One of which it is the special case is none: where both fit, the one with fewer numbers is meant.
    """
    effects = search.best.hypothesis.effects
    others = (x for x in _last_rivals(search) if _place(search.best, x) == index)
    wider = {x.id for x in EFFECTS.values() if effects[index] in x.generalises}
    others = (x for x in others if _name(search.best, x) not in wider)
    others = (x for x in others if not is_with_a_loop(x, search.best, search.problem))
    known = {x.id: x for x in sorted(search.verdict.rivals, key=lambda x: (x.plainer, x.as_large, x.other_side))}
    tried = search.found.last_ranking
    names = ((_name(search.best, x), worse_by(search.found, x, tried)) for x in others)
    found = _once(replace(known.get(name, Rival(name, 0.0)), difference=x) for name, x in names)
    if found or len(effects) == 1:
        return found or _once(search.verdict.rivals)
    ranking = search.found.ranking
    own = _difference(ranking, effects[index])
    if index > 0 or own is None:
        return ()
    others = (Rival(x.fitted.hypothesis.effects[-1], x.difference - own) for x in ranking)
    return _once(x for x in others if x.id not in {*effects, *wider})


def _against(search: SearchResult, other: Fitted) -> tuple[Rival, ...]:
    """Return the rivals of a rival: the best one, and those that the best one has."""
    last = _name(search.best, other)
    own = next((x.difference for x in search.verdict.rivals if x.id == last), 0.0)
    rest = _once(Rival(x.id, x.difference - own) for x in search.verdict.rivals if x.id != last)
    return (Rival(search.best.hypothesis.effects[_place(search.best, other)], -own), *rest)


def _difference(ranking: Sequence[Ranked], effect: str) -> float | None:
    return next((x.difference for x in ranking if x.fitted.hypothesis.effects[-1] == effect), None)


def _once(rivals: Iterable[Rival]) -> tuple[Rival, ...]:
    """Return each rival once, the best first; one that diverges under the record, whose cost is infinite, is none."""
    best: dict[str, Rival] = {}
    for rival in (x for x in rivals if math.isfinite(x.difference)):
        if rival.id not in best or rival.difference < best[rival.id].difference:
            best[rival.id] = rival
    return tuple(sorted(best.values(), key=lambda x: x.difference))
