"""The search for missing effects: add one at a time, keep several leaders, look back, stop at the noise."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from bender_compiled.abreast import abreast
from bender_discrepancy.effects.form import Form
from bender_discrepancy.fitting.criterion import STARTS_OF_A_FORM, Yardstick, cost, yardstick
from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import Fitted, fit, judge, recounted
from bender_discrepancy.fitting.own_numbers import beside_the_catalogue
from bender_discrepancy.records.observations import Observations, only_one_sine
from bender_discrepancy.search.budget import BUDGET
from bender_discrepancy.search.certain import certain, with_lags_moved
from bender_discrepancy.search.evidence import (
    EVIDENCE,
    Evidence,
    is_enough,
    is_finished,
    is_material,
    removes_most,
    simplest_as_good,
)
from bender_discrepancy.search.own_alone import likelier, own_alone, own_first
from bender_discrepancy.search.revise import in_simple_forms, in_their_best_forms, looked_back
from bender_discrepancy.search.set_aside import cleared, settled, to_the_end
from bender_discrepancy.search.start import begun_better
from bender_discrepancy.search.state import Found, Ranked, noise_of, rms_um, work_so_far
from bender_discrepancy.search.step import at_aliases, at_other_rings, most_promising_first, tried_on
from bender_discrepancy.search.together import several_are_missing, together
from bender_discrepancy.search.verdict import would_stand

Progress = Callable[[str], None]
Keep = Callable[[Found], None]


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """What a search may choose from.

    Attributes:
        forms: of the effects.
        first: forms of which one each is sought before all others: what a witness shows.
        own: frees the model's own linear numbers; None where it has none but gain and offset.
        from_rest: of every record, its observations from rest; none where the beginning is known.
        evidence: the constants that decide.
        most: effects in one hypothesis.
    """

    forms: tuple[Form, ...]
    first: tuple[tuple[Form, ...], ...] = ()
    own: Form | None = None
    from_rest: tuple[Observations, ...] = ()
    evidence: Evidence = EVIDENCE
    most: int = BUDGET.effects


def search(
    problem: FitProblem,
    forms: Sequence[Form] | Candidates,
    progress: Progress | None = None,
    keep: Keep | None = None,
) -> Found:
    """Search for missing effects; `keep` gets what was found so far, after the first ranking and after every step.

    A search sets out with each record begun as its observations say. Where what it finds fits better with another
    beginning, it is done again from there, once.

    Raises:
        ValueError: the model as given cannot be simulated under the drive of the records.
    """
    among = forms if isinstance(forms, Candidates) else Candidates(tuple(forms))
    tell, hand_over = progress or (lambda _: None), keep or (lambda _: None)
    found = _beside_own_or_given(problem, among, tell, hand_over, may_begin_anew=True)
    other = begun_better(found, among.from_rest)
    if other is not None:
        tell("another beginning of the record fits better: searching again")
        again = _beside_own_or_given(other, among, tell, hand_over, may_begin_anew=False)
        found = again if cost(again.best, again.yardstick) <= cost(found.best, again.yardstick) else found
    return to_the_end(in_their_best_forms(found, among.forms, among.evidence))


def _beside_own_or_given(
    problem: FitProblem, among: Candidates, tell: Progress, hand_over: Keep, *, may_begin_anew: bool
) -> Found:
    """Search beside the model's own numbers as given and, where they are far off, beside others of them first.

    Where what is found beside those stands, with effects or without, a single effect beside the numbers as given may
    still do better.
    """
    evidence = among.evidence
    may_lead = not among.first and among.own is not None and beside_the_catalogue(among.own) is not None
    off = own_first(_set_out(problem, evidence), among.own, evidence) if may_lead else None
    if off is None:
        return _own_alone(_searched(problem, among, tell, hand_over, may_begin_anew=may_begin_anew), among)
    tell("numbers of the model are off: searching beside others of them")
    beside = (
        off if _is_finished(off, evidence) else _searched(problem, among, tell, hand_over, off, may_begin_anew=False)
    )
    beside = _own_alone(beside, among)
    tell("searching beside the numbers as given")
    if _is_finished(beside, evidence) or _stands(beside, evidence):
        hand_over(beside)
        given = _searched(problem, replace(among, most=1), tell, lambda _: None, may_begin_anew=False)
    else:
        given = _searched(problem, among, tell, hand_over, may_begin_anew=False)
    found = likelier(beside, given, evidence)
    return _own_alone(found, among) if found is given else found


def _searched(
    problem: FitProblem,
    among: Candidates,
    tell: Progress,
    hand_over: Keep,
    begun: Found | None = None,
    *,
    may_begin_anew: bool,
) -> Found:
    found = begun or _with_shown(_set_out(problem, among.evidence), among, tell, hand_over)
    if _is_explained(found, among.evidence):
        return found
    ahead: _Ahead | None = _Ahead([found.best])
    work = [work_so_far(problem)]
    for depth in range(1, among.most + 1 - len(found.best.hypothesis.parts)):
        models = f"{len(ahead.beam)} model{'s' * (len(ahead.beam) > 1)}"
        tell(f"step {depth}: trying {len(among.forms)} forms on {models}")
        weighed = _weighed(found, ahead.beam, among, work)
        if weighed is None:
            found = replace(found, stopped=not _is_affordable(found, work, among.evidence))
            break
        found = weighed.found
        if depth == 1 and may_begin_anew:
            leader = replace(found, best=weighed.leader)
            other = begun_better(leader, among.from_rest, may_have_moved=_is_finished(leader, among.evidence))
            if other is not None:
                tell("another beginning of the record fits better: beginning again")
                return _searched(other, among, tell, hand_over, may_begin_anew=False)
        if depth == 1:
            found = replace(found, ranking=found.ranking or tuple(weighed.ranked))
            hand_over(found)
        if weighed.enough:
            before = found
            known = replace(found, yardstick=weighed.by, last_ranking=tuple(weighed.ranked))
            found = certain(_accepted(known, weighed.best, among, tell), among.evidence, among.forms, among.most)
            hand_over(found)
            ahead = _following(found, before, among.evidence, ahead)
        else:
            ahead = _elsewhere(found, weighed, ahead, among.evidence, tell)
            found = found if ahead else settled(found)
        if ahead is None:
            break
    return _together(found, among, tell, hand_over)


def _together(found: Found, among: Candidates, tell: Progress, hand_over: Keep) -> Found:
    """Return what was found, or several more effects where all of them leave noise alone, each of them certain."""
    evidence = among.evidence
    if _is_finished(found, evidence) or among.most == 1 or only_one_sine(found.problem.observations):
        return found
    stands = _stands(found, evidence)
    if not several_are_missing(found, evidence, stands=stands):
        return found
    more = together(found, among.forms, among.most, evidence, tell, while_most=stands)
    if more is None:
        return found
    known = replace(more, best=more.base, steps=more.steps[:-1])
    more = certain(_accepted(known, more.best, among, tell), evidence, among.forms, among.most)
    if not (_is_explained(more, evidence) and is_enough(found, more.best, more.yardstick, evidence)):
        return found
    # what leaves noise alone has not been broken off
    more = replace(more, stopped=False)
    hand_over(more)
    return more


def _elsewhere(found: Found, weighed: "_Weighed", ahead: "_Ahead", by: Evidence, tell: Progress) -> "_Ahead | None":
    """Return where the search goes on after a step that was not enough; None where it is over.

    One effect alone may explain little where two are missing: two are tried at once, on leaders that explain some.
    Where that helps no more, and what was found would not stand, it goes on from models that led less.
    """
    if _is_finished(found, by):
        return None
    if not ahead.looked:
        explaining = [x for x in weighed.ranked[1:] if x.difference < -weighed.by.threshold]
        following = _Ahead.of(_leaders(explaining, weighed.ranked[0].fitted, weighed.by), looked=True)
        return replace(following, spare=ahead.spare or following.spare)
    if not ahead.spare or _stands(found, by):
        return None
    tell("no step helps: going on from models that led less")
    return _Ahead(ahead.spare, looked=True)


def _stands(found: Found, by: Evidence) -> bool:
    """Return whether the effects found would be named, no lag of theirs being as good on the other side."""
    return would_stand(found, by) and would_stand(with_lags_moved(found, by), by)


def _own_alone(found: Found, among: Candidates) -> Found:
    return own_alone(found, among.own, among.forms, among.most, among.evidence)


def _is_finished(found: Found, evidence: Evidence) -> bool:
    """Return whether what was found leaves nothing in which another effect could be sought."""
    return is_finished(found.best, found, evidence)


def _set_out(problem: FitProblem, evidence: Evidence) -> Found:
    """Return what is known before anything is sought: the model as given, recalibrated."""
    base = judge(problem, Hypothesis())
    if base is None:
        raise ValueError("the model as given cannot be simulated under the voltage of the record")
    by = yardstick(problem, base, 1, evidence.confidence)
    found = settled(Found(problem, base, base, noise_of(base, problem), by, steps=(base,)))
    return replace(found, base=found.best)


def _is_explained(found: Found, evidence: Evidence) -> bool:
    """Return whether effects were found, and leave nothing in which another one could be sought."""
    return bool(found.best.hypothesis.parts) and _is_finished(found, evidence)


def _with_shown(found: Found, among: Candidates, tell: Progress, hand_over: Keep) -> Found:
    """Return what was found with the effects that witnesses show, as far as the readings feel them.

    That they are there is known from elsewhere: they need not stand out among all others, nor in blocks of their own.
    """
    for forms in among.first:
        tell(f"trying what another channel shows: {', '.join(dict.fromkeys(x.effect for x in forms))}")
        tried = tried_on(found, found.best, forms, ())
        if not tried:
            continue
        leader = min(tried, key=lambda x: x.training_square)
        found, tried, leader = cleared(found, tried, leader)
        by = yardstick(found.problem, leader, len(forms), among.evidence.confidence)
        ranked = _ranked(tried, found.best, by)
        best = ranked[0].fitted
        gained = cost(found.best, by) - cost(best, by) > by.threshold
        if not gained or not is_material(found.best, best, found, among.evidence):
            continue
        known = replace(found, yardstick=by, ranking=found.ranking or tuple(ranked), last_ranking=tuple(ranked))
        found = _accepted(known, best, among, tell)
        hand_over(found)
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _Weighed:
    """Hypotheses of one effect more, weighed: with what was found, the best of them, and whether it is enough."""

    found: Found
    leader: Fitted
    by: Yardstick
    ranked: list[Ranked]
    best: Fitted
    enough: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Ahead:
    """Where the next step sets out from.

    Attributes:
        beam: models that effects are tried on.
        spare: the next ones, for when no step helps.
        looked: a step has been made without being enough, or goes on from others than the best.
    """

    beam: Sequence[Fitted]
    spare: Sequence[Fitted] = ()
    looked: bool = False

    @classmethod
    def of(cls, leaders: Sequence[Fitted], *, looked: bool = False) -> "_Ahead":
        """Return the first models as the beam and the next ones as spare ones."""
        beam = most_promising_first(leaders[: BUDGET.beam])
        return cls(beam, leaders[BUDGET.beam : 2 * BUDGET.beam], looked)


def _weighed(found: Found, beam: Sequence[Fitted], among: Candidates, work: list[int]) -> _Weighed | None:
    """Try an effect more on the leading model, and on the others of the beam where that is not enough.

    None where nothing could be tried or it would take too long; `work` has the sub-steps simulated before every step.
    """
    tried: list[Fitted] = []
    weighed: _Weighed | None = None
    for parents in (beam[:1], beam[1:]):
        if not parents:
            break
        work.append(work_so_far(found.problem))
        if not _is_affordable(found, work, among.evidence):
            break
        more = _tried(found, parents, among, tried)
        if not more:
            continue
        leader = min((*tried, *more), key=lambda x: x.training_square)
        if leader in more and len(leader.hypothesis.parts) > 1:
            more.append(looked_back(found.problem, leader, among.forms, found.noise_um))
            more += _in_simple_forms(found, parents[0], among, [*tried, *more])
            leader = min((*tried, *more), key=lambda x: x.training_square)
        elif leader in more:
            more += [x for x in [at_aliases(found.problem, leader)] if x is not leader]
            leader = min((*tried, *more), key=lambda x: x.training_square)
        more += [x for x in [at_other_rings(found.problem, leader)] if x is not leader]
        leader = min((*tried, *more), key=lambda x: x.training_square)
        known_um = found.noise_um
        found, tried, leader = cleared(found, [*tried, *more], leader)
        by = yardstick(found.problem, leader, STARTS_OF_A_FORM * len(among.forms), among.evidence.confidence)
        ranked = _ranked(tried, found.best, by)
        if ranked[0].difference >= 0.0:
            # nothing explains more than noise would: one more estimate of the same floor is smaller by chance alone
            found = replace(found, noise_um=known_um)
        found = replace(found, led=found.led | {x.fitted.hypothesis.effects[-1] for x in ranked})
        best = _first_enough(found, ranked, by, among.evidence)
        weighed = _Weighed(found, leader, by, ranked, best or ranked[0].fitted, best is not None)
        if weighed.enough:
            break
    return weighed


def _first_enough(found: Found, ranked: Sequence[Ranked], by: Yardstick, evidence: Evidence) -> Fitted | None:
    """Return the best of what was tried for which the evidence is enough.

    Beside effects that were found, the criterion makes little of what is slow: the one that it favours may remove too
    little, where another one removes most.
    """
    others = (x.fitted for x in ranked if removes_most(found.best, x.fitted, found, evidence))
    tried = (_simplest(found, ranked, evidence), *(others if found.best.hypothesis.parts else ()))
    return next((x for x in tried if is_enough(found, x, by, evidence)), None)


def _is_affordable(found: Found, work: Sequence[int], by: Evidence) -> bool:
    expected = work[-1] + BUDGET.work_growth * (work[-1] - work[-2]) - work[0]
    # where effects close most of the gap, it is likelier that another one of the catalogue is missing
    closing = len(found.best.hypothesis.parts) if removes_most(found.base, found.best, found, by) else 0
    deeper = 1.0 + BUDGET.per_effect * closing
    return expected <= deeper * BUDGET.work_for(found.problem.all_rows)


def _tried(found: Found, parents: Sequence[Fitted], among: Candidates, before: Sequence[Fitted]) -> list[Fitted]:
    """Return hypotheses of one effect more than some models; `before` are those that others of them have led to."""
    tried = _tried_on_all(found, parents, among.forms, before)
    return tried + _with_own_numbers(found, tried, among)


def _in_simple_forms(found: Found, parent: Fitted, among: Candidates, tried: Sequence[Fitted]) -> list[Fitted]:
    """Return the effects that lead, on a model whose effects have other simple forms, where structure is left."""
    leaders = sorted(tried, key=lambda x: x.training_square)
    if rms_um(leaders[0], found.problem, held=False) < BUDGET.nearly_done * found.noise_um:
        return []
    leading = list(dict.fromkeys(x.hypothesis.effects[-1] for x in leaders))[: BUDGET.fitted_later]
    forms = [x for x in among.forms if x.effect in leading]
    most = BUDGET.behind * parent.training_square
    more: list[Fitted] = []
    for other in in_simple_forms(found.problem, parent, among.forms, found.noise_um, most):
        more += tried_on(found, other, forms, [*tried, *more])
    return more


def _with_own_numbers(found: Found, tried: Sequence[Fitted], among: Candidates) -> list[Fitted]:
    """Return the leaders with the model's own linear numbers free beside their effects, where structure is left.

    Those that the freed numbers bring no further than an effect would have to are left out.
    """
    if among.own is None or not tried or only_one_sine(found.problem.observations):
        return []
    leaders = sorted((x for x in tried if x.hypothesis.own is None), key=lambda x: x.training_square)
    # what few numbers do is soon passed by many, until the model's own are right
    simplest = min(leaders, key=lambda x: x.hypothesis.free_count, default=None)
    leaders = leaders[: BUDGET.own_tried]
    leaders += [simplest] if simplest is not None and simplest not in leaders else []
    if not leaders or rms_um(leaders[0], found.problem, held=False) < BUDGET.nearly_done * found.noise_um:
        return []
    given = tuple(x.starts[0] for x in among.own.free)
    alone = fit(found.problem, Hypothesis().freeing(among.own, given))
    starts = [given]
    if alone is not None and alone.hypothesis.own is not None:
        starts.append(alone.hypothesis.own.values)
    own = among.own
    hypotheses = [x.hypothesis.freeing(own, start) for x in leaders for start in starts]
    fits = abreast(lambda x: fit(found.problem, x), hypotheses)
    freed: list[Fitted] = []
    for k, x in enumerate(leaders):
        alive = [y for y in fits[k * len(starts) : (k + 1) * len(starts)] if y is not None]
        best = min(alive, key=lambda y: y.training_square, default=None)
        freed += [best] if best is not None and is_material(x, best, found, among.evidence) else []
    return freed


def _tried_on_all(
    found: Found, parents: Sequence[Fitted], forms: Sequence[Form], before: Sequence[Fitted]
) -> list[Fitted]:
    """Try the effects on one model after the other, until one leaves noise alone."""
    tried: list[Fitted] = []
    for parent in parents:
        tried += tried_on(found, parent, forms, [*before, *tried])
        if any(rms_um(x, found.problem, held=False) < BUDGET.nearly_done * found.noise_um for x in tried):
            break
    return tried


def _simplest(found: Found, ranked: Sequence[Ranked], evidence: Evidence) -> Fitted:
    """Return the best of what was tried, or a far simpler one that is as good."""
    done = is_finished(ranked[0].fitted, found, evidence)
    return simplest_as_good([x.fitted for x in ranked], found.base, nothing_left=done)


def replaced(found: Found, forms: Sequence[Form], evidence: Evidence = EVIDENCE) -> Found:
    """Try every likely effect in every form in the place of each one of the best hypothesis, while the others stand.

    Likely are those that led at any step. What was tried joins the last ranking: an early
    choice has rivals as the last one has. In the place of freed numbers of the model, any effect may have moved them.
    Beside an effect in another form, another one may lead in the place of a third.
    """
    problem, by, ranked = found.problem, found.yardstick, list(found.last_ranking)
    best = found.best
    likely = [x for x in forms if x.effect in found.led | set(best.hypothesis.effects)]
    shown = [x for x in forms if x.shown]
    seen: set[frozenset[str]] = set()
    for turn in range(BUDGET.replaced_near):
        if turn >= BUDGET.replaced and rms_um(best, problem, held=False) > BUDGET.near * found.noise_um:
            break
        tried: list[Fitted] = []
        for shorter in (x for x in best.hypothesis.lacking_one() if x.parts):
            rest = None if _form_names(shorter) in seen else judge(problem, shorter)
            seen.add(_form_names(shorter))
            if rest is not None and not shorter.keeps_shown_of(best.hypothesis):
                tried += tried_on(found, rest, shown, [best])
            elif rest is not None and shorter.own is best.hypothesis.own:
                tried += tried_on(found, rest, likely, [best])
            elif rest is not None:
                tried += tried_on(found, rest, forms, ())
        if rms_um(best, problem, held=False) >= BUDGET.nearly_done * found.noise_um:
            # beside another effect, a frequency may be another one of its aliases
            leaders = sorted(tried, key=lambda x: x.training_square)[: BUDGET.beam]
            tried += [y for x in leaders if (y := at_aliases(problem, x)) is not x]
        ranked = _ranked([best, *tried, *(x.fitted for x in ranked)], found.steps[-2], by)
        material = [x for x in ranked if x.fitted is best or is_material(found.steps[-2], x.fitted, found, evidence)]
        first = _simplest(found, material, evidence)
        if _form_names(first.hypothesis) == _form_names(best.hypothesis):
            break
        best = first
    return replace(found, best=best, last_ranking=tuple(ranked), steps=(*found.steps[:-1], best))


def pruned(found: Found, fitted: Fitted, evidence: Evidence = EVIDENCE) -> Fitted:
    """Take out effects, and freed numbers of the model, that the others have made needless.

    Without them no evidence is lost, or nothing that matters.
    """
    problem, by = found.problem, found.yardstick
    while len(fitted.hypothesis.all_parts) > 1:
        shorter = [x for x in fitted.hypothesis.lacking_one() if x.parts and x.keeps_shown_of(fitted.hypothesis)]
        without = abreast(lambda x: fit(problem, x), shorter)
        alive = [x for x in without if x is not None]
        cheapest = min(alive, key=lambda x: cost(x, by), default=None)
        if cheapest is None:
            return fitted
        lost = cost(cheapest, by) - cost(fitted, by) > by.threshold
        if lost and is_material(cheapest, fitted, found, evidence):
            return fitted
        fitted = cheapest
    return fitted


def _says_no_more(found: Found) -> bool:
    """Return whether records of one frequency at one amplitude have shown a memory: the residual cannot be named."""
    return any(x.form.memory for x in found.best.hypothesis.parts) and only_one_sine(found.problem.observations)


def _accepted(found: Found, best: Fitted, among: Candidates, tell: Progress) -> Found:
    """Return what was found with one more effect: needless ones taken out, early ones replaced by better ones."""
    before = found.steps[-1]
    best = pruned(found, best, among.evidence)
    found = replace(found, best=best, steps=(*found.steps, best))
    if len(best.hypothesis.all_parts) > 1:
        tell("trying others in the place of each")
        found = replaced(found, among.forms, among.evidence)
        best = pruned(found, found.best, among.evidence)
        found = replace(found, best=best, steps=(*found.steps[:-1], best))
    found = to_the_end(settled(found))
    again = [recounted(x.fitted, found.problem) for x in found.last_ranking]
    return replace(found, last_ranking=tuple(_ranked(again, before, found.yardstick)))


def _form_names(hypothesis: Hypothesis) -> frozenset[str]:
    return frozenset(part.form.name for part in hypothesis.all_parts)


def _ranked(tried: Sequence[Fitted], before: Fitted, by: Yardstick) -> list[Ranked]:
    """Return hypotheses with the criterion's difference to the one before, best first, each set of forms once."""
    ranked = sorted((Ranked(x, cost(x, by) - cost(before, by)) for x in tried), key=lambda x: x.difference)
    once: dict[frozenset[str], Ranked] = {}
    for x in ranked:
        once.setdefault(_form_names(x.fitted.hypothesis), x)
    return list(once.values())


def _following(found: Found, before: Found, by: Evidence, ahead: "_Ahead") -> "_Ahead | None":
    """Return the models that the next step sets out from; None where the search is over.

    What was added without being certain would be the first to be added again: the step goes on from the others, once,
    where these leave anything.
    """
    if _is_finished(found, by) or _says_no_more(found):
        return None
    leaders = _leaders(found.last_ranking, found.best, found.yardstick)
    if not _adds_nothing(found, before):
        return _Ahead.of(leaders)
    others = [x for x in leaders[1:] if not _is_finished(replace(found, best=x), by)]
    return _Ahead.of(others, looked=True) if others and not ahead.looked else None


def _adds_nothing(found: Found, before: Found) -> bool:
    now, earlier = (x.best.hypothesis for x in (found, before))
    same = set(now.effects) == set(earlier.effects) and _form_names(now) == _form_names(earlier)
    return same or set(now.effects) < set(earlier.effects)


def _leaders(ranked: Sequence[Ranked], best: Fitted, by: Yardstick) -> list[Fitted]:
    """Return the best hypothesis of every set of effects, the given one first; none that only adds to it in vain."""
    leaders = [best]
    for x in ranked:
        effects = set(x.fitted.hypothesis.effects)
        in_vain = effects > set(best.hypothesis.effects) and cost(x.fitted, by) >= cost(best, by)
        if not in_vain and all(effects != set(y.hypothesis.effects) for y in leaders):
            leaders.append(x.fitted)
    return leaders
