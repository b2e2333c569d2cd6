"""How sure each effect of the best hypothesis is: the case against it is the best hypothesis without it.

An effect is certain where everything that was tried without it predicts unseen blocks worse by more than chance and
more than the forms of the catalogue may be off. Where structure is left, it must also close most of what all that
leaves, and know more than the time: what does not interpolates well inside a record, whatever is missing. Else it has
a probability.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import ndtri

from bender_effects.catalogue import EFFECTS
from bender_effects.form import Free
from bender_inference.fitting.blocked import least_beside_a_block
from bender_inference.fitting.criterion import Yardstick, cost, yardstick
from bender_inference.fitting.hypothesis import Part
from bender_inference.fitting.output_error import Fitted, judge
from bender_inference.fitting.uncertainty import uncertainty
from bender_inference.records.observations import Array, hardly_steps, only_one_sine, turns_plays
from bender_inference.search.archive import Archive, left_square
from bender_inference.search.judgement.probability import Case, probability
from bender_inference.search.judgement.rules import (
    RULES,
    Rules,
    above_floor_um2,
    ended_without_answer,
    is_special_case,
)
from bender_inference.search.noise import floor_limit
from bender_inference.search.search import Searched

Grade = Literal["certain", "likely", "possible"]
# why the final numbers leave open whether an effect is there; "" where they do not
Doubt = Literal["", "size", "share"]
# why the records cannot exclude a rival; "" where they do
Reach = Literal["", "predicts as well", "fits as well", "plainer", "other side", "as large"]
MOST_WEIGHED = 12
TWO_SIDED_95 = float(ndtri(0.975))
FADES = 2.0
"""Deviations by which a rival is behind where its probability has fallen to 1/e; set by hand."""


@dataclass(frozen=True, slots=True, eq=False)
class Rival:
    """Another effect in the place of one of the best hypothesis.

    Attributes:
        id: of the effect.
        fitted: the hypothesis that has it.
        difference: of the information criterion, by which it is worse than the best.
        deviations: by which the best predicts unseen blocks better.
        reach: why the records cannot exclude it; "" where they do.
    """

    id: str
    fitted: Fitted
    difference: float
    deviations: float
    reach: Reach


@dataclass(frozen=True, slots=True, eq=False)
class Graded:
    """One effect of the best hypothesis, and how sure it is.

    Attributes:
        index: its place in the hypothesis.
        id: of the effect.
        grade: certain, likely or possible.
        probability: that it is there.
        without: the best hypothesis with all the others, but not with it.
        difference: of the information criterion, by which that is worse.
        case: against it.
        rivals: what was fitted in its place, best first.
        doubt: its size may be none, or hardly any of the gap is its.
    """

    index: int
    id: str
    grade: Grade
    probability: float
    without: Fitted
    difference: float
    case: Case
    rivals: tuple[Rival, ...] = ()
    doubt: Doubt = ""

    @property
    def open_rivals(self) -> tuple[Rival, ...]:
        """Those that the records cannot exclude."""
        return tuple(x for x in self.rivals if x.reach)

    @property
    def near_rivals(self) -> tuple[Rival, ...]:
        """Those of them that fit as well as what was found, and do not only leave less than twice as much."""
        return tuple(x for x in self.open_rivals if x.reach != "as large")

    def probability_of(self, rival: Rival) -> float:
        """Return the probability of a rival: that of the effect, or of the rest, and less the further it is behind."""
        return min(self.probability, 1.0 - self.probability) * math.exp(-max(rival.deviations, 0.0) / FADES)


@dataclass(frozen=True, slots=True, eq=False)
class Grades:
    """The effects of the best hypothesis, in the order of adding, and what of the gap stays open.

    Attributes:
        effects: graded.
        complete: nothing above the noise stays unexplained.
        closed: part of the gap's variance above the noise that the best hypothesis closes.
        one_sine: an effect with a memory was found from one frequency at one amplitude: it could be any of them.
        commuting: the best hypothesis has two effects that may as well change their sides.
        by: what differences of the criterion are weighed with.
    """

    effects: tuple[Graded, ...]
    complete: bool
    closed: float
    one_sine: bool
    commuting: bool
    by: Yardstick


def grade(searched: Searched, rules: Rules) -> Grades:
    """Return how sure each effect of the best hypothesis is, from what the archive holds."""
    archive, base, best = searched.archive, searched.base, searched.best
    by = yardstick(archive.problem, best, len(archive.fits), rules.confidence)
    complete = is_complete(archive, rules, base, best)
    closed = rules.closed_share(archive, base, best)
    sine = _one_sine(archive, best)
    steps = hardly_steps(archive.problem.observations)
    found = tuple(
        _graded(archive, rules, base, best, k, by, complete=complete, closed=closed)
        for k in range(len(best.hypothesis.parts))
    )
    commuting = _commute(archive, best, by, rules)
    if sine or commuting:
        found = tuple(x if not _is_touched(best, x, sine) else at_most_likely(x) for x in found)
    if steps:
        even = (replace(at_most_likely(x), probability=min(x.probability, rules.likely)) for x in found)
        stands = (EFFECTS[x.id].superposes or best.hypothesis.parts[x.index].form.shown for x in found)
        found = tuple(x if z else y for x, y, z in zip(found, even, stands, strict=True))
    return Grades(found, complete, closed, sine, commuting, by)


def relevant_part(searched: Searched, rules: Rules) -> Searched:
    """Return the search with what its relevant effects say alone: another one goes where nobody misses it.

    Nobody does where the others leave less than the relevant part of the stroke without it. An effect of that size
    stays where it closes what they leave as far as a gap has to be closed, or to noise alone: of structure like that of
    a busy machine between command and reading, any form may take up a part. It does not where one block alone shows it.
    """
    if not searched.best.hypothesis.parts:
        return searched
    archive, grades = searched.archive, grade(searched, rules)
    for x in sorted(grades.effects, key=lambda x: x.probability):
        is_left = len(x.without.hypothesis.parts) == len(searched.best.hypothesis.parts) - 1
        if not is_left or rules.is_relevant(archive, x.without):
            continue
        is_rest = rules.closed_share(archive, x.without, searched.best) >= rules.closes
        is_rest = is_rest or _takes_all_structure(archive, rules, x.without, searched.best)
        if not is_rest or _is_shown_once(archive, rules, x.without, searched.best):
            return relevant_part(replace(searched, best=x.without), rules)
    return searched


def _is_shown_once(archive: Archive, rules: Rules, without: Fitted, best: Fitted) -> bool:
    """Return whether one block alone shows an effect.

    Then a hypothesis without it, fitted to all other blocks, leaves of these by chance no more than noise, or than the
    best one leaves of all. What happens once may be an accident, and many a form can stand in for it.
    """
    problem = archive.problem
    least = left_square(best) / max(problem.all_rows, 1)
    if all(x.half_step_um == 0.0 for x in problem.observations):
        # of coarse readings only what lies beyond their steps is left, of the noise too
        least = max(archive.noise_um**2, least)
    return least_beside_a_block(problem, without) <= floor_limit(problem, rules.confidence, judged=False) * least


def _takes_all_structure(archive: Archive, rules: Rules, without: Fitted, fitted: Fitted) -> bool:
    """Return whether a hypothesis leaves noise alone where one without an effect of it leaves more."""
    if rules.leaves_noise(archive, without, everywhere=True):
        return False
    return rules.leaves_noise(archive, fitted, everywhere=True)


def is_complete(archive: Archive, rules: Rules, base: Fitted, best: Fitted) -> bool:
    """Return whether what the best hypothesis leaves is noise.

    Beside an effect that was found, structure below the noise cannot be told from what its form leaves of nature's.
    """
    if best.hypothesis.parts:
        return rules.is_small(archive, base, best)
    return rules.leaves_noise(archive, best)


def _graded(
    archive: Archive,
    rules: Rules,
    base: Fitted,
    best: Fitted,
    index: int,
    by: Yardstick,
    *,
    complete: bool,
    closed: float,
) -> Graded:
    part = best.hypothesis.parts[index]
    effect = part.form.effect
    lacking = [x for x in archive.lacking(effect) if _counts_against(archive, best, x)]
    with_others = set(best.hypothesis.effects) - {effect}
    subsets = [x for x in lacking if set(x.hypothesis.effects) <= set(best.hypothesis.effects)]
    without = archive.best(x for x in subsets if set(x.hypothesis.effects) == with_others) or base
    rivals = _rivals(archive, rules, base, best, lacking, by, complete=complete)
    curve = _curve_alone(archive, best, index)
    nearest = archive.best((*subsets, *curve, *(x.fitted for x in rivals))) or base
    against = archive.difference(_strongest(archive, rules, best), nearest)
    rest, left = (above_floor_um2(archive, x) for x in (nearest, best))
    case = Case.of(against.deviations, rest, left, closed)
    alone = len(best.hypothesis.parts) == 1
    is_needed = (alone or rules.is_material(archive, base, without, best)) and all(
        rules.is_material(archive, base, x, best) for x in curve
    )
    is_needed = is_needed and not any(rules.is_of_last_percent(archive, base, x, best) for x in (without, *curve))
    is_shown = all(archive.difference(best, x).deviations > rules.certain_deviations for x in (without, *curve))
    is_proved = complete or (left <= (1.0 - rules.closes) * rest and not EFFECTS[effect].of_the_record)
    is_certain = is_shown and is_needed and is_proved and not any(x.reach for x in rivals)
    is_certain = is_certain and _is_determined(archive, best, index)
    is_certain = is_certain and not _is_shown_once(archive, rules, without, best)
    is_certain = is_certain or part.form.shown
    case = replace(case, passed=is_certain)
    likely = 1.0 if part.form.shown else probability(case)
    word: Grade = "certain" if is_certain else "likely" if likely >= rules.likely else "possible"
    return Graded(
        index, effect, word, likely, without, cost(without, by) - cost(best, by), case, tuple(rivals)
    )  # fmt: skip


def _curve_alone(archive: Archive, best: Fitted, index: int) -> tuple[Fitted, ...]:
    """Return the best hypothesis with the curve beside which an effect has its loop, but not with that; () of others.

    Of a form that is two effects, one may do all that it does.
    """
    parts = best.hypothesis.parts
    if not parts[index].form.curve:
        return ()
    rest = Part(*parts[index].form.curve_alone(parts[index].values))
    found = archive.compared(replace(best.hypothesis, parts=(*parts[:index], rest, *parts[index + 1 :])))
    return () if found is None else (found,)


def _strongest(archive: Archive, rules: Rules, best: Fitted) -> Fitted:
    """Return what predicts best of all that has the effects of the best hypothesis, in whatever forms.

    That an effect is there is a question of its own: the form that is carried best may be a plainer one.
    """
    effects = sorted(best.hypothesis.effects)
    same = (x for x in archive.fits if sorted(x.hypothesis.effects) == effects and rules.is_in_range(archive, x))
    return archive.best((best, *same)) or best


def _is_determined(archive: Archive, best: Fitted, index: int) -> bool:
    """Return whether the numbers of an effect say that it is this one.

    Where records have numbers of their own, those of one of them are enough: another one may have none of the effect.
    """
    parts = best.hypothesis.parts
    part, first = parts[index], sum(len(x.values) for x in parts[:index])
    if ended_without_answer(part):
        return False
    if len(part.values) == 1 and not part.form.free[0].no_answer_at:
        return True
    variances = np.diag(uncertainty(archive.problem, best).coordinates)[first : first + len(part.values)]
    size = len(part.values) // part.form.records
    sets = [slice(k * size, (k + 1) * size) for k in range(part.form.records)]
    return any(_are_told(part.form.free[x], part.values[x], variances[x]) for x in sets)


def _are_told(numbers: Sequence[Free], values: Sequence[float], variances: Array) -> bool:
    """Return whether numbers say that an effect is this one.

    They do not where the 95 % interval of one of them holds an end of its range that is no answer, nor where several
    make up for one another until none of them is told: then the records determine a response that other forms have too.
    """
    are_open = []
    for free, value, variance in zip(numbers, values, variances, strict=True):
        deviation = math.sqrt(max(float(variance), 0.0)) if np.isfinite(variance) else math.inf
        are_open.append(deviation > (1.0 if free.log else abs(free.inward(value))))
        ends = (free.low, free.high)
        if math.isfinite(deviation):
            ends = tuple(free.outward(free.inward(value) + sign * TWO_SIDED_95 * deviation) for sign in (-1.0, 1.0))
        if any(free.ends_without_answer(x) for x in ends):
            return False
    return len(are_open) == 1 or not all(are_open)


def _counts_against(archive: Archive, best: Fitted, other: Fitted) -> bool:
    """Return whether a hypothesis without an effect of the best one tells against that effect.

    Not where the best one is its special case: where both fit, the one with fewer numbers is meant. Nor where it has a
    loop beside a curve in the place of that curve, on records that turn loops.
    """
    if not is_special_case(best.hypothesis, other.hypothesis):
        return True
    is_with_a_loop = any(x.form.beside in best.hypothesis.effects for x in other.hypothesis.parts)
    return is_with_a_loop and not turns_plays(archive.problem.observations)


def _rivals(
    archive: Archive,
    rules: Rules,
    base: Fitted,
    best: Fitted,
    lacking: Sequence[Fitted],
    by: Yardstick,
    *,
    complete: bool,
) -> list[Rival]:
    """Return what has another effect in the place of one, each once, best first; what is no model is none of them."""
    own = set(best.hypothesis.effects)
    once: dict[str, Fitted] = {}
    for x in archive.by_fit(lacking):
        others = [y for y in x.hypothesis.effects if y not in own]
        if (
            others
            and len(x.hypothesis.parts) <= len(best.hypothesis.parts)
            and x.hypothesis.keeps_shown_of(best.hypothesis)
            and (others[-1] in once or rules.is_in_range(archive, x))
        ):
            once.setdefault(others[-1], x)
    found = []
    for effect, fitted in list(once.items())[:MOST_WEIGHED]:
        against = archive.difference(best, fitted)
        worse = cost(fitted, by) - cost(best, by)
        reach = _reach(archive, rules, base, best, fitted, against.deviations, worse, complete=complete)
        found.append(Rival(effect, fitted, worse, against.deviations, reach))
    return sorted(found, key=lambda x: archive.square(x.fitted))


def _reach(
    archive: Archive,
    rules: Rules,
    base: Fitted,
    best: Fitted,
    other: Fitted,
    deviations: float,
    worse: float,
    *,
    complete: bool,
) -> Reach:
    """Return why the records cannot exclude a rival; "" where they do.

    One that fits all rows as well stays, however it predicts: blocks taken out of a record that hardly excites it tell
    which form has the better determined numbers, not which effect there is.

    Where structure is left in any case, a form may by chance take up as much of it as another one leaves. Where none
    is, no name depends on the last percent of the gap: forms are not nature's to that.
    """
    if deviations < rules.certain_deviations:
        return "predicts as well"
    if worse < rules.very_strong:
        return "fits as well"
    rest, left = (above_floor_um2(archive, x) for x in (other, best))
    lost = set(best.hypothesis.effects) - set(other.hypothesis.effects)
    more = set(other.hypothesis.effects) - set(best.hypothesis.effects)
    if not complete:
        includes = {y for x in lost for y in EFFECTS[x].includes}
        return "as large" if rest * rules.remainder < left and not more <= includes else ""
    within = rules.is_of_last_percent(archive, base, other, best)
    if within and other.hypothesis.free_count < best.hypothesis.free_count:
        return "plainer"
    sides = {EFFECTS[x].same_on_other_side for x in lost}
    has_side = not all(EFFECTS[x].superposes for x in best.hypothesis.effects)
    by_chance = left > (1.0 - rules.remainder) ** 2 * rest
    if within and len(lost) == 1 and more == sides and has_side and by_chance:
        return "other side"
    return ""


def _one_sine(archive: Archive, best: Fitted) -> bool:
    told = (part.form.memory and not part.form.shown for part in best.hypothesis.parts)
    return any(told) and only_one_sine(archive.problem.observations)


def _commute(archive: Archive, best: Fitted, by: Yardstick, rules: Rules) -> bool:
    """Return whether two effects on either side of the plant fit as well with each other's numbers.

    The plant between them is linear then, as far as the records show, and both may as well be on one side.
    """
    parts = {x.form.effect: x for x in best.hypothesis.parts}
    pairs = [(x, EFFECTS[x].same_on_other_side) for x in parts if EFFECTS[x].same_on_other_side in parts]
    if not pairs or any(x.form.shown for x in best.hypothesis.parts):
        return False
    first = {x: parts[x].values[:1] for pair in pairs for x in pair}
    exchanged = tuple(
        replace(x, values=first[EFFECTS[x.form.effect].same_on_other_side] + x.values[1:])
        if x.form.effect in first
        else x
        for x in best.hypothesis.parts
    )
    other = judge(archive.problem, replace(best.hypothesis, parts=exchanged))
    return other is not None and cost(other, by) - cost(best, by) < rules.very_strong


def _is_touched(best: Fitted, graded: Graded, one_sine: bool) -> bool:
    form = best.hypothesis.parts[graded.index].form
    touched = form.memory if one_sine else bool(EFFECTS[graded.id].same_on_other_side)
    return touched and not form.shown


def contradicted(graded: Graded, closed: float) -> Graded:
    """Return an effect of which reported rows close another part of the gap: nothing is certain of it.

    Args:
        graded: as the rows of the choices have it.
        closed: part of the gap's variance that the corrected model closes in the others.
    """
    return _by(graded, graded.case.seen_by_none(closed))


def doubted(graded: Graded, doubt: Doubt) -> Graded:
    """Return an effect of which the final numbers leave open whether it is there: it is not certain."""
    return replace(at_most_likely(graded), doubt=doubt)


def at_most_likely(graded: Graded) -> Graded:
    """Return an effect that is not certain, whatever it was."""
    return _by(graded, replace(graded.case, passed=False)) if graded.grade == "certain" else graded


def _by(graded: Graded, case: Case) -> Graded:
    """Return an effect that has not passed by a case that is no better than its own."""
    likely = min(graded.probability, probability(case))
    word: Grade = "likely" if likely >= RULES.likely else "possible"
    return replace(graded, grade=word, probability=likely, case=case)
