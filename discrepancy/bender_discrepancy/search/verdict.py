"""What may be said: named, ambiguous, unexplained, recalibrated or no gap, and on what evidence."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.fitting.blocked import again_on_other_blocks
from bender_discrepancy.fitting.criterion import CONFIDENCE, cost, very_strong
from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.fitting.own_numbers import first_mode
from bender_discrepancy.records.observations import only_one_sine
from bender_discrepancy.search.certain import LEAVE_NO_SIDE, OTHER_SIDE, lags_commute
from bender_discrepancy.search.evidence import (
    EVIDENCE,
    Evidence,
    closed_share,
    energy_at_floor,
    extremes_at_floor,
    floor_limit,
    floor_square_um2,
    is_overtaken,
    is_plainer,
    is_small,
    is_with_a_loop,
    is_within_last_percent,
)
from bender_discrepancy.search.state import Found, Ranked, readings_square_um2, square_um2


@dataclass(frozen=True, slots=True)
class Rival:
    """Another effect in the place of a named one.

    Attributes:
        id: of the effect.
        difference: of the criterion, by which it is worse; one of more effects is held to the best beside further
            ones as well.
        plainer: it has fewer numbers, and what it leaves more is within the last percent of the gap, to which no form
            is nature's; the best effects do not beat it with as few.
        as_large: what it leaves above the noise is less than twice that of the best, where structure is left in any
            case: by chance, a form may take up as much of what another one leaves.
        other_side: it is the same lag on the other side of the plant, noise alone is left with it, what it leaves more
            is within that percent, and the best leaves more than half the size of it above the noise.
    """

    id: str
    difference: float
    plainer: bool = False
    as_large: bool = False
    other_side: bool = False

    def is_close(self, confidence: float = CONFIDENCE) -> bool:
        """Return whether the records cannot exclude it."""
        return self.plainer or self.as_large or self.other_side or self.difference < very_strong(confidence)


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict, why, and the rivals of the last effect.

    Attributes:
        word: the contract's.
        reason: in one sentence, without the size of the residual: that is measured later, on rows that no choice sees.
        rivals: of the last effect, best first.
        complete: whether nothing is left above the noise floor.
        commuting: the best hypothesis has two lags that commute.
    """

    word: str
    reason: str
    rivals: tuple[Rival, ...] = ()
    complete: bool = True
    commuting: bool = False


def rivals_of(found: Found, ranking: Sequence[Ranked], by: Evidence = EVIDENCE) -> tuple[Rival, ...]:
    """Return the other effects that were fitted in the place of the last one, best first."""
    if not ranking:
        return ()
    best = set(found.best.hypothesis.effects)
    # one with all these effects and more is no rival of theirs, nor is one that lacks one of them and has no other
    others = [x for x in ranking if not best <= _changes(found, x.fitted) and _adds_another(x, best)]
    others = [x for x in others if not _is_special(best, set(x.fitted.hypothesis.effects))]
    others = [x for x in others if not is_with_a_loop(x.fitted, found.best, found.problem)]
    worse = [(x.fitted, worse_by(found, x.fitted, ranking)) for x in others]
    return tuple(
        Rival(
            x.hypothesis.effects[stand_in(found.best, x)],
            difference,
            is_plainer(x, found.best, found.base) and not _is_beaten_plainly(found, x, ranking, by),
            _is_as_large(found, x, ranking, by),
            _is_other_side(found, x, by),
        )
        for x, difference in worse
        if difference > 0.0 or not is_overtaken(x, found.best)
    )


def stand_in(best: Fitted, other: Fitted) -> int:
    """Return which effect of another hypothesis stands in the place of one of the best, the last that the best lacks.

    Effects stand in the order in which they were found: the last one of all may be one that both have.
    """
    known = set(best.hypothesis.effects)
    effects = other.hypothesis.effects
    return max((k for k, x in enumerate(effects) if x not in known), default=len(effects) - 1)


def _is_other_side(found: Found, other: Fitted, by: Evidence) -> bool:
    """Return whether another hypothesis has a lag on the other side, and leaves noise alone as well.

    A wrong side may follow better what the forms of other effects leave. Beside none, or such as superpose, there is
    nothing that has a side, and the criterion decides; it does where the other side leaves more than noise by chance,
    and where the best leaves less than half the size of it: one number takes up no more of another form's inadequacy.
    """
    best, theirs = set(found.best.hypothesis.effects), set(other.hypothesis.effects)
    own, more = best - theirs, theirs - best
    if len(own) != 1 or more != {OTHER_SIDE.get(next(iter(own)))} or best <= LEAVE_NO_SIDE:
        return False
    most = floor_limit(found.problem, by.confidence) * found.noise_um**2
    if square_um2(other, found.problem) > most or not is_within_last_percent(other, found.best, found.base):
        return False
    left, theirs_left = (_above_noise_um2(found, x) for x in (found.best, other))
    return left > (1.0 - by.mopped_up) ** 2 * theirs_left


def _is_beaten_plainly(found: Found, other: Fitted, ranking: Sequence[Ranked], by: Evidence) -> bool:
    """Return whether the best effects beat a plainer hypothesis in a form with as few numbers as that one has.

    Then it is not the further numbers that decide between them.
    """
    best, count = set(found.best.hypothesis.effects), other.hypothesis.free_count
    as_plain = (x.fitted for x in ranking if set(x.fitted.hypothesis.effects) == best)
    costs = [cost(x, found.yardstick) for x in as_plain if x.hypothesis.free_count <= count]
    return cost(other, found.yardstick) - min(costs, default=math.inf) > very_strong(by.confidence)


def _changes(found: Found, other: Fitted) -> set[str]:
    """Return the effects of a hypothesis, and those of the best one that the model's own numbers are beside them.

    Another frequency of the model, fitted beside a damping, is the same change as the effect of that name. It counts
    where it lies nearer to where the effect takes it than to where the model has it.
    """
    effects = set(other.hypothesis.effects)
    if other.hypothesis.own is None:
        return effects
    base = found.problem.base
    given, best, theirs = (
        first_mode(x) for x in (base, found.best.hypothesis.model(base), other.hypothesis.model(base))
    )
    for effect in set(found.best.hypothesis.effects) & set(given):
        whole = math.log(best[effect] / given[effect])
        if math.log(theirs[effect] / given[effect]) * math.copysign(1.0, whole) > 0.5 * abs(whole):
            effects.add(effect)
    return effects


def _is_as_large(found: Found, other: Fitted, ranking: Sequence[Ranked], by: Evidence) -> bool:
    """Return whether another hypothesis leaves less than twice as much, and the best one's names are not true of it.

    One of more effects than the best is held to the best beside those of them that stand in the place of none.
    """
    best, theirs = set(found.best.hypothesis.effects), set(other.hypothesis.effects)
    own, more = best - theirs, theirs - best
    if len(own) == len(more) == 1 and more <= set(EFFECTS[next(iter(own))].includes):
        return False
    least = min(_above_noise_um2(found, x) for x in _as_many(found, other, ranking))
    return least > (1.0 - by.mopped_up) * _above_noise_um2(found, other)


def worse_by(found: Found, other: Fitted, ranking: Sequence[Ranked]) -> float:
    """Return by how much another hypothesis is worse than the best, beside as many further effects as it has more."""
    least = min(cost(x, found.yardstick) for x in _as_many(found, other, ranking))
    return cost(other, found.yardstick) - least


def _as_many(found: Found, other: Fitted, ranking: Sequence[Ranked]) -> list[Fitted]:
    """Return the best hypothesis, and those of it and further effects that another one has, as many as that one has."""
    best, theirs = set(found.best.hypothesis.effects), set(other.hypothesis.effects)
    return [found.best, *(x.fitted for x in ranking if _is_beside(set(x.fitted.hypothesis.effects), best, theirs))]


def _is_beside(effects: set[str], best: set[str], theirs: set[str]) -> bool:
    """Return whether these are the best's effects and further ones of another hypothesis, as many as it has."""
    return best < effects and effects - best <= theirs and len(effects) == len(theirs)


def _above_noise_um2(found: Found, fitted: Fitted) -> float:
    return max(square_um2(fitted, found.problem) - found.noise_um**2, 0.0)


def _is_special(best: set[str], other: set[str]) -> bool:
    """Return whether the best is the other with numbers alike: where both fit, the one with fewer numbers is meant."""
    own, more = best - other, other - best
    return len(own) == len(more) == 1 and own <= set(EFFECTS[next(iter(more))].generalises)


def _adds_another(ranked: Ranked, best: set[str]) -> bool:
    return not set(ranked.fitted.hypothesis.effects) <= best


def is_complete(problem: FitProblem, found: Found, by: Evidence = EVIDENCE) -> bool:
    """Return whether what the best hypothesis leaves is noise, in energy and in extremes.

    Beside an effect that was found, structure below the noise cannot be told from what its form leaves of nature's.
    """
    best, noise = found.best, found.noise_um
    if best.hypothesis.parts:
        return is_small(best, found, by)
    return energy_at_floor(best, problem, noise, by.confidence) and extremes_at_floor(best, problem, noise)


def unstretched(found: Found, by: Evidence = EVIDENCE) -> Found:
    """Return what was found without effects that cover a part of something else.

    Where structure is left, effects stand only if they close most of the gap and would be named again on other
    blocks; those that do not may as well be stretched over what the catalogue does not have.
    """
    if not found.best.hypothesis.parts or is_complete(found.problem, found, by):
        return found
    if closed_share(found, found.best) >= by.closes and _again(found):
        return found
    return replace(found, best=found.base, steps=(found.base,))


def _again(found: Found) -> bool:
    """Return whether the effects together would be named again on other blocks."""
    return again_on_other_blocks(found.problem, found.best, found.base)


def one_loop(problem: FitProblem, found: Found) -> bool:
    """Return whether an effect with a memory was found from one frequency at one amplitude: it could be any of them.

    One that a witness shows is there, whatever the readings say.
    """
    told = (part.form.memory and not part.form.shown for part in found.best.hypothesis.parts)
    return any(told) and only_one_sine(problem.observations)


def decide(problem: FitProblem, found: Found, by: Evidence = EVIDENCE) -> Verdict:
    """Return the verdict on what a search found."""
    if not found.best.hypothesis.parts:
        return _without_effects(problem, found, by)
    complete = is_complete(problem, found, by)
    enough = complete or closed_share(found, found.best) >= by.closes
    rivals = _that_count(rivals_of(found, found.last_ranking, by), complete)
    if not enough:
        return Verdict(
            "unexplained", "the residual has structure above the noise that no effect explains", rivals, complete=False
        )
    if one_loop(problem, found):
        reason = "one frequency at one amplitude cannot distinguish effects with a memory"
        return Verdict("ambiguous", reason, rivals, complete)
    close = [x for x in rivals if x.is_close(by.confidence)]
    if close:
        return Verdict("ambiguous", _why_close(close), rivals, complete)
    if lags_commute(found, by):
        reason = "the two lags fit as well with each other's time constants; what is read back between them would tell"
        return Verdict("ambiguous", reason, rivals, complete, commuting=True)
    if complete:
        reason = "every effect passed its tests, and the residual is at the noise floor"
        return Verdict("named", reason, rivals)
    reason = "every effect passed its tests; structure above the noise stays unexplained"
    return Verdict("named", reason, rivals, complete=False)


def _that_count(rivals: Sequence[Rival], complete: bool) -> tuple[Rival, ...]:
    """Return rivals without what counts only where structure is left in any case, or only where none is."""
    return tuple(
        replace(x, as_large=False) if complete else replace(x, plainer=False, other_side=False) for x in rivals
    )


def _why_close(close: Sequence[Rival]) -> str:
    names = ", ".join(dict.fromkeys(x.id for x in close))
    if all(x.other_side for x in close):
        return f"with {names}, the same lag on the other side, noise alone is left too, by the last percent of the gap"
    if not all(x.as_large for x in close):
        return f"the records fit {names} as well within the evidence that they hold"
    return f"structure is left in any case, and with {names} in its place it is less than twice as large"


def would_stand(found: Found, by: Evidence = EVIDENCE) -> bool:
    """Return whether the effects found would be named, though structure may be left beside them."""
    if not found.best.hypothesis.parts:
        return False
    complete = is_complete(found.problem, found, by)
    rivals = _that_count(rivals_of(found, found.last_ranking, by), complete)
    enough = complete or closed_share(found, found.best) >= by.closes
    return enough and not any(x.is_close(by.confidence) for x in rivals)


def as_given_square(problem: FitProblem, found: Found) -> float:
    """Return the mean square on the rows of choices of the model as given, before any calibration."""
    readings = problem.readings(found.base.hypothesis)
    if readings is None:
        return math.inf
    rows = sum(int(x.judging.sum()) for x in problem.observations)
    square = sum(
        float(((x.measured_um - y)[x.judging] ** 2).sum()) for x, y in zip(problem.observations, readings, strict=True)
    )
    return square / max(rows, 1)


def calibration_matters(problem: FitProblem, found: Found, by: Evidence = EVIDENCE) -> bool:
    """Return whether gain and offset change the readings by a part of the noise that is worth a word."""
    gained = as_given_square(problem, found) - readings_square_um2(problem, found.base)
    return gained > by.matters**2 * floor_square_um2(problem, found.noise_um)


def _without_effects(problem: FitProblem, found: Found, by: Evidence) -> Verdict:
    if not energy_at_floor(found.best, problem, found.noise_um, by.confidence):
        return Verdict("unexplained", "the residual has structure above the noise", complete=False)
    if not extremes_at_floor(found.best, problem, found.noise_um):
        reason = "some consecutive readings lie further from the simulation than noise explains"
        return Verdict("unexplained", reason, complete=False)
    if found.best.hypothesis.own is not None:
        return Verdict("recalibrated", "numbers of the model were off; nothing else is missing")
    if calibration_matters(problem, found, by):
        return Verdict("recalibrated", "gain and offset of the reading were off; nothing else is missing")
    return Verdict("no_gap", "simulation and measurement differ by noise alone")
