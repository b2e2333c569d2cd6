"""The search for what is missing: grow, improve, make the case against every effect.

Floating search (Pudil, Novovičová and Kittler 1994, doi:10.1016/0167-8655(94)90127-9): effects are added as long as
held-out blocks are predicted better. After every step, earlier choices are revised.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.journal import current_journal
from bender_inference.fitting.output_error import Fitted
from bender_inference.fitting.own_numbers import changes_as_effects, form_without_named, part_without_named
from bender_inference.records.observations import only_one_sine
from bender_inference.search.archive import Archive, judged, left_square
from bender_inference.search.budget import BUDGET, CORE_S_PER_SUBSTEP
from bender_inference.search.explore import explore, explore_beside_each
from bender_inference.search.judgement.rules import Rules, above_floor_um2, is_special_case
from bender_inference.search.moves import ADJUST, AGAINST, BESIDE, GROW, POLISH, Catalogue, Move
from bender_inference.search.transfer import best_carried

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Searched:
    """What a search leaves.

    Attributes:
        archive: every fit, with the readings that count at the end.
        base: the model as given, recalibrated.
        best: what stands at the end.
        stopped: a further step would have gone beyond the budget.
    """

    archive: Archive
    base: Fitted
    best: Fitted
    stopped: bool = False


Begin = Callable[[Searched], FitProblem | None]


def search(
    problem: FitProblem,
    catalogue: Catalogue,
    rules: Rules,
    tell: Progress = lambda _: None,
    keep: Callable[[Searched], None] = lambda _: None,
    begin: Begin = lambda _: None,
    spent_substeps: int = 0,
) -> Searched:
    """Search for missing effects.

    Args:
        problem: the model as given and the records.
        catalogue: what may be chosen from.
        rules: the constants that decide.
        tell: is told what is being done.
        keep: gets what was found so far, after every step.
        begin: returns the problem with another beginning of the records, where that fits clearly better.
        spent_substeps: simulated by a search of these records at another beginning, up to its last step: both together
            take about what one of the most effects may, the second at least what one without effects may.

    Raises:
        ValueError: the model as given cannot be simulated under the drive of the records.
    """
    archive, before = Archive(problem), problem.work_substeps
    if (journal := current_journal()) is not None:
        journal.begin_search()
    best = archive.set_aside(_root(archive, catalogue, rules))
    roots = [x for x in archive.fits if not _is_led_astray(archive, rules, x)]
    beam, in_vain, stopped, leader = leading_fits(roots, len(catalogue.kits)), 0, False, best
    most_substeps = BUDGET.work_for(problem.all_rows, catalogue.most) - spent_substeps
    most_substeps = max(most_substeps, BUDGET.work_for(problem.all_rows, 0))
    done = 0
    while beam and _goes_on(archive, rules, best, leader, in_vain):
        done = _done_substeps(problem.work_substeps - before)
        if stopped := done > min(BUDGET.work_for(archive.problem.all_rows, len(best.hypothesis.parts)), most_substeps):
            break
        depth = 1 + max(len(x.hypothesis.parts) for x in beam)
        if not (
            found := _grown(archive, catalogue, beam, partial(_say_step, tell, archive, catalogue, depth, len(beam)))
        ):
            break
        if depth > 1:
            found += _beside_others(archive, catalogue, rules, min(found, key=lambda x: x.training_square), beam)
        leader = archive.set_aside(min(found, key=lambda x: x.training_square))
        leader = improved(archive, catalogue, rules, leader, ADJUST)
        if depth == 1 and (other := begin(Searched(archive, _base(archive, leader), leader))) is not None:
            tell("another beginning of the record fits better: beginning again")
            return search(other, catalogue, rules, tell, keep, spent_substeps=spent_substeps + done)
        earlier, best = best, parsimonious(archive, rules)
        in_vain = 0 if _has_gained(archive, rules, earlier, best) else in_vain + 1
        keep(Searched(archive, _base(archive, best), best))
        beam = leading_fits(
            [x for x in archive.fits if len(x.hypothesis.parts) == depth and rules.is_in_range(archive, x)]
        )
    if best.hypothesis.parts and not stopped and rules.is_finished(archive, _base(archive, best), best):
        tell("trying two effects in the place of one")
        _replaced(archive, catalogue, rules, best)
    most = _done_substeps(problem.work_substeps - before) + BUDGET.work_for(archive.problem.all_rows, 0)

    def goes_on() -> bool:
        return not stopped and _done_substeps(problem.work_substeps - before) <= most

    best = _polished(archive, catalogue, rules, tell, goes_on)
    found = Searched(archive, _base(archive, best), best, stopped)
    if (other := begin(found)) is None:
        return found
    tell("another beginning of the record fits better: searching again")
    return search(other, catalogue, rules, tell, keep, spent_substeps=spent_substeps + done)


def _say_step(tell: Progress, archive: Archive, catalogue: Catalogue, depth: int, models: int, place: int) -> None:
    """Say which model a step tries; at first, for how long steps are begun, as far as it is known beforehand."""
    said = f"step {depth}: trying {len(catalogue.kits[0].forms)} forms on model {place} of {models}"
    if depth == 1:
        core_s = CORE_S_PER_SUBSTEP * BUDGET.work_for(archive.problem.all_rows, 0)
        said += f"; steps are begun for some {core_s:.0f} s of an idle core, and as long again for each effect found"
    tell(said)


def _has_gained(archive: Archive, rules: Rules, before: Fitted, best: Fitted) -> bool:
    """Return whether a step led to another hypothesis, and removes more than forms may miss."""
    return best is not before and rules.is_material(archive, _base(archive, best), before, best)


def _goes_on(archive: Archive, rules: Rules, best: Fitted, leader: Fitted, in_vain: int) -> bool:
    """Return whether a further effect is sought: more than noise is left, and not too many steps brought nothing.

    One is enough where so much is closed that the forms of what was found may have missed the rest, unless the leader
    of that step is half of the way to what no form misses.
    """
    base = _base(archive, best)
    if rules.is_finished(archive, base, best):
        return False
    is_open = rules.closed_share(archive, base, best) < rules.closes or rules.is_half_way(archive, best, leader)
    return in_vain <= (BUDGET.patience if is_open else 0)


def _is_evident(archive: Archive, rules: Rules, without: Fitted | None, best: Fitted) -> bool:
    """Return whether what one hypothesis has more predicts better than chance, and removes more than forms may miss."""
    if without is None:
        return True
    return rules.gains(archive, best, without) and rules.is_material(archive, _base(archive, best), without, best)


def _polished(
    archive: Archive, catalogue: Catalogue, rules: Rules, tell: Progress, goes_on: Callable[[], bool]
) -> Fitted:
    """Return the best hypothesis once its effects have been changed in turn and taken out, fitted to the end.

    They are changed as long as `goes_on`; the case against each is always made.
    """
    best = parsimonious(archive, rules)
    for _ in range(BUDGET.turns if best.hypothesis.parts else 0):
        if not goes_on():
            break
        tell("trying others in the place of each")
        explore(archive, catalogue, [best], POLISH, goes_on)
        archive.set_aside(min(archive.fits, key=lambda x: x.training_square))
        before, best = best, parsimonious(archive, rules)
        if set(before.hypothesis.effects) == set(best.hypothesis.effects):
            break
    if best.hypothesis.parts:
        tell("making the case against each effect")
        explore(archive, catalogue, [with_named_numbers(archive, catalogue, rules, best)], AGAINST)
        best = with_named_numbers(archive, catalogue, rules, parsimonious(archive, rules))
    if best.hypothesis.parts and not rules.is_finished(archive, _base(archive, best), best):
        best = best_carried(archive, rules, best)
    closest = archive.fit(best.hypothesis, closely=True) if best.hypothesis.free else None
    # what only follows its own rows more closely is not nearer to the device
    if closest is None or not rules.is_in_range(archive, closest) or archive.square(closest) > archive.square(best):
        return best
    return archive.set_aside(closest)


def with_named_numbers(archive: Archive, catalogue: Catalogue, rules: Rules, best: Fitted) -> Fitted:
    """Return a hypothesis with another frequency and another damping called by their names, where these are evidence.

    What is predicted clearly better with such a number free, and by more than forms may miss, has the number's name;
    else it is a recalibration. So is all of it where structure is left, which such a number takes up as any form does.
    """
    hypothesis, own = best.hypothesis, best.hypothesis.own
    if own is None or not rules.is_finished(archive, _base(archive, best), best):
        return best
    evident = []
    for part in changes_as_effects(own, catalogue.kit(hypothesis).forms):
        without = archive.fit(replace(hypothesis, own=part_without_named(own, {part.form.effect})))
        if _is_evident(archive, rules, without, best):
            evident.append(part)
    if not evident or len(hypothesis.parts) + len(evident) > catalogue.most:
        return best
    rest = part_without_named(own, {x.form.effect for x in evident})
    return archive.fit(replace(hypothesis, parts=(*hypothesis.parts, *evident), own=rest)) or best


def improved(archive: Archive, catalogue: Catalogue, rules: Rules, fitted: Fitted, moves: Sequence[Move]) -> Fitted:
    """Return a hypothesis, or what some moves lead to from it as long as that leaves less."""
    for _ in range(BUDGET.turns):
        if _is_nearly_done(archive, fitted) or not fitted.hypothesis.parts:
            break
        found = explore(archive, catalogue, [fitted], moves)
        best = min((fitted, *found), key=lambda x: x.training_square)
        if best is fitted or not rules.is_preferred(archive, best, fitted):
            break
        fitted = archive.set_aside(best)
    return fitted


def parsimonious(archive: Archive, rules: Rules, refuted: Fitted | None = None) -> Fitted:
    """Return the simplest hypothesis that predicts held-out blocks as well as the best one.

    As well is: within one standard error; or nothing is left in which the further effects could show; or they take off
    no more than the form of another effect may leave. Where no hypothesis is within its range, one without effects
    stands. One of the same effects as a refuted one does not count.
    """
    refused = None if refuted is None else set(refuted.hypothesis.effects)
    fits = [x for x in archive.fits if set(x.hypothesis.effects) != refused and rules.is_in_range(archive, x)]
    fits = fits or [x for x in archive.fits if not x.hypothesis.parts]
    best = archive.best(fits) or fits[0]
    base, effects = _base(archive, best), set(best.hypothesis.effects)
    fewer = [x for x in fits if _is_simpler(x, best)]
    as_good = [x for x in fewer if _is_as_good(archive, rules, base, x, best, effects)]
    if any(rules.is_finished(archive, base, x) for x in (best, *as_good)):
        least = min(len(x.hypothesis.parts) for x in (best, *as_good))
        alike = [x for x in (best, *as_good) if len(x.hypothesis.parts) == least]
    else:
        plainest = min((best, *as_good), key=lambda x: (rules.complexity(archive, x), archive.square(x)))
        alike = [x for x in (best, *as_good) if set(x.hypothesis.effects) == set(plainest.hypothesis.effects)]
    first = archive.best(alike) or best
    # of the same effects, the form with fewest numbers; an effect that is a special case of another one is its form
    same = [x for x in alike if _is_form_of(x.hypothesis, first.hypothesis)]
    plain = [x for x in same if x is first or _is_plainer_alike(archive, rules, base, x, first)]
    return min(plain, key=lambda x: (x.hypothesis.free_count, archive.square(x)))


def _is_form_of(one: Hypothesis, other: Hypothesis) -> bool:
    return set(one.effects) == set(other.effects) or is_special_case(one, other)


def _is_plainer_alike(archive: Archive, rules: Rules, base: Fitted, simple: Fitted, first: Fitted) -> bool:
    """Return whether another form of the same effects predicts as well, or is far simpler and hardly worse."""
    far = first.hypothesis.free_count - simple.hypothesis.free_count >= rules.fewer_numbers
    far = far or is_special_case(simple.hypothesis, first.hypothesis)
    return (far and _is_close(archive, rules, base, simple, first)) or not rules.is_preferred(archive, first, simple)


def _is_close(archive: Archive, rules: Rules, base: Fitted, simple: Fitted, first: Fitted) -> bool:
    """Return whether a hypothesis leaves no more than another one by what no form is nature's in."""
    within = rules.last_percent**2 * above_floor_um2(archive, base)
    return above_floor_um2(archive, simple) - above_floor_um2(archive, first) <= within


def _is_simpler(one: Fitted, other: Fitted) -> bool:
    return one is not other and len(one.hypothesis.effects) <= len(other.hypothesis.effects)


def _is_as_good(archive: Archive, rules: Rules, base: Fitted, simple: Fitted, best: Fitted, effects: set[str]) -> bool:
    if not simple.hypothesis.keeps_shown_of(best.hypothesis):
        return False
    if is_special_case(simple.hypothesis, best.hypothesis) and _is_close(archive, rules, base, simple, best):
        return True
    if _stands_in(archive, rules, simple, best):
        return False
    if simple.hypothesis.parts and rules.is_small(archive, base, simple):
        return True
    if len(simple.hypothesis.parts) < len(effects) and not rules.is_material(archive, base, simple, best):
        return True
    is_far = left_square(simple) > BUDGET.behind * archive.square(best) * archive.problem.all_rows
    return not is_far and not rules.is_preferred(archive, best, simple)


def _stands_in(archive: Archive, rules: Rules, simple: Fitted, best: Fitted) -> bool:
    """Return whether a hypothesis leaves more than noise where another one, that is no richer form of it, does not.

    What several numbers more remove beside the same effects may be what the forms of these leave. What a single number
    removes to the noise is an effect, and so is what others leave without any of these.
    """
    one, other = simple.hypothesis, best.hypothesis
    more = [x for x in other.parts if x.form.effect not in one.effects]
    if set(one.effects) <= set(other.effects) and any(len(x.values) > 1 for x in more):
        return False
    if not more or rules.leaves_noise(archive, simple, everywhere=True):
        return False
    return rules.leaves_noise(archive, best, everywhere=True)


def _grown(archive: Archive, catalogue: Catalogue, beam: Sequence[Fitted], say: Callable[[int], None]) -> list[Fitted]:
    """Return hypotheses of one effect more; `say` is told which parent is tried, from 1.

    Once one takes off most of what its parent left, only parents that leave even less are still tried.
    """
    found: list[Fitted] = []
    is_far = False
    for place, parent in enumerate(beam, 1):
        if is_far and parent.training_square >= min(x.training_square for x in found):
            continue
        say(place)
        more = explore(archive, catalogue, [parent], GROW)
        leaders = leading_fits(more)
        if leaders and not _is_nearly_done(archive, leaders[0]) and not only_one_sine(archive.problem.observations):
            more += explore(archive, catalogue, leaders, BESIDE)
        found += more
        if any(_is_nearly_done(archive, x) for x in more):
            break
        least = min((x.training_square for x in more), default=math.inf)
        is_far = is_far or least <= BUDGET.enough * parent.training_square
    return found


def _beside_others(
    archive: Archive, catalogue: Catalogue, rules: Rules, leader: Fitted, stepped: Sequence[Fitted]
) -> list[Fitted]:
    """Return hypotheses of one effect more than some have, on others of as many, where the leader leaves structure.

    Args:
        archive: keeps the fits.
        catalogue: what may be chosen from.
        rules: the constants that decide.
        leader: what leaves least so far.
        stepped: the hypotheses that need no step.
    """
    if rules.leaves_noise(archive, leader, everywhere=True):
        return []
    known = {frozenset(x.hypothesis.effects) for x in stepped}
    depth = max(len(x.hypothesis.parts) for x in stepped)
    others = [
        x
        for x in archive.fits
        if len(x.hypothesis.parts) == depth
        and frozenset(x.hypothesis.effects) not in known
        and rules.is_in_range(archive, x)
    ]
    more = explore_beside_each(archive, catalogue, _every_kind(others), leader.training_square)
    leaders = leading_fits(more) if more else []
    return more + explore(archive, catalogue, leaders, BESIDE)


def _replaced(archive: Archive, catalogue: Catalogue, rules: Rules, best: Fitted) -> None:
    """Try two effects in the place of one that leaves little, but more than noise: it may stand in for them."""
    found = _beside_others(archive, catalogue, rules, best, [best])
    if found:
        leader = archive.set_aside(min(found, key=lambda x: x.training_square))
        improved(archive, catalogue, rules, leader, ADJUST)


def _every_kind(fits: Sequence[Fitted]) -> list[Fitted]:
    """Return the best fit of few and of many numbers of different effects, best first."""
    best: dict[tuple[object, ...], Fitted] = {}
    for x in sorted(fits, key=lambda x: x.training_square):
        structure, last = x.hypothesis.structure, x.hypothesis.parts[-1]
        key = None if structure is None else structure.name, frozenset(x.hypothesis.effects)
        best.setdefault((*key, len(last.values) > BUDGET.few_numbers), x)
    return list(best.values())[: BUDGET.wide]


def _root(archive: Archive, catalogue: Catalogue, rules: Rules) -> Fitted:
    """Return the model that leaves least: as given, or with lags of its own that fit better, or with what is shown.

    What a witness shows is known from elsewhere: it needs not stand out among others.
    """
    roots = []
    for kit in catalogue.kits:
        bare = judged(archive, Hypothesis(structure=kit.structure))
        own = None if kit.own is None else form_without_named(kit.own, {x.effect for x in kit.forms})
        freed = None
        frees = own is not None and not kit.hidden and not only_one_sine(archive.problem.observations)
        if bare is not None and own is not None and frees:
            freed = archive.fit(bare.hypothesis.freeing(own, tuple(x.starts[0] for x in own.free)))
        roots += [x for x in (bare, freed) if x is not None]
    if not roots:
        raise ValueError("the model as given cannot be simulated under the voltage of the record")
    root = archive.set_aside(min(roots, key=lambda x: x.training_square))
    for forms in catalogue.shown:
        only = replace(catalogue, kits=tuple(replace(x, forms=forms) for x in catalogue.kits))
        parent = root if root.hypothesis.own is None else _base(archive, root)
        tried = explore(archive, only, [parent], GROW)
        best = min(tried, key=lambda x: x.training_square, default=None)
        if best is not None and rules.is_preferred(archive, best, parent):
            root = best
    return root


def _is_led_astray(archive: Archive, rules: Rules, fitted: Fitted) -> bool:
    """Return whether a structure predicts worse with its numbers free: they run away where an effect hides it."""
    bare = archive.bare(fitted.hypothesis.structure)
    return bare is not None and fitted.hypothesis.own is not None and rules.is_preferred(archive, bare, fitted)


def _base(archive: Archive, fitted: Fitted) -> Fitted:
    """Return the linear structure of a hypothesis, recalibrated."""
    return archive.bare(fitted.hypothesis.structure) or archive.fits[0]


def leading_fits(fits: Sequence[Fitted], most: int = BUDGET.beam) -> list[Fitted]:
    """Return the fits of different effects that leave least, at most one of many numbers among them, and that last.

    What many numbers leave says little of what is missing, and a step on them takes long: they come last, but where
    they leave far less than all others. Those with them on top would only leave as much.
    """
    leaders: dict[tuple[object, ...], Fitted] = {}
    for x in sorted(fits, key=lambda x: x.training_square):
        structure = x.hypothesis.structure
        leaders.setdefault((None if structure is None else structure.name, frozenset(x.hypothesis.effects)), x)
    fewest = min((x.hypothesis.free_count for x in leaders.values()), default=0)
    simple = [x for x in leaders.values() if x.hypothesis.free_count <= fewest + BUDGET.few_numbers]
    flexible = [x for x in leaders.values() if x not in simple][:1]
    kept = simple[: max(most, BUDGET.beam) - len(flexible)]
    is_far = any(x.training_square <= BUDGET.enough * y.training_square for x in flexible for y in kept[:1])
    return [*flexible, *kept] if is_far else [*kept, *flexible]


def _is_nearly_done(archive: Archive, fitted: Fitted) -> bool:
    rows = sum(int(x.training.sum()) for x in archive.problem.observations)
    return fitted.training_square <= rows * (BUDGET.nearly_done * archive.noise_um) ** 2


def _done_substeps(simulated: int) -> int:
    """Return the work of a search before a step, counting that of the search that it goes on with."""
    journal = current_journal()
    return simulated if journal is None else journal.work_so_far(simulated)
