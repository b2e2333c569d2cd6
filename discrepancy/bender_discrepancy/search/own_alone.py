"""Gain, lags, delay, frequency and damping of the model by themselves, in the place of effects and beside them."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

from bender_compiled.abreast import abreast
from bender_discrepancy.effects.form import Form, Values, simple
from bender_discrepancy.fitting.criterion import cost, very_strong, yardstick
from bender_discrepancy.fitting.hypothesis import Hypothesis, Part
from bender_discrepancy.fitting.output_error import Fitted, fit
from bender_discrepancy.fitting.own_numbers import OWN_DELAY, beside_the_catalogue, told_as_effects
from bender_discrepancy.fitting.scans.delay import scan_delay
from bender_discrepancy.records.observations import only_one_sine
from bender_discrepancy.search.certain import certain
from bender_discrepancy.search.evidence import EVIDENCE, Evidence, is_enough, is_finished, is_material, removes_most
from bender_discrepancy.search.set_aside import settled
from bender_discrepancy.search.state import Found
from bender_discrepancy.search.step import at_aliases
from bender_plant.blocks import transport_delay

DELAYS = 3
"""From so many valleys of the delay, besides where the model has it, its own numbers are fitted."""


def own_alone(found: Found, own: Form | None, forms: Sequence[Form], most: int, evidence: Evidence = EVIDENCE) -> Found:
    """Return what was found, or the model's own linear numbers by themselves where no effect is needed beside them.

    Effects beside which these numbers were freed must be worth their own. Where structure is left, with effects or
    without, the numbers must show as an effect has to: one of them that is off may look like an effect from afar.
    """
    best = found.best
    if own is None or only_one_sine(found.problem.observations):
        return found
    if best.hypothesis.own is None and is_finished(best, found, evidence):
        return _with_a_lag_for_an_effect(found, own, evidence)
    if best.hypothesis.own is not None:
        best = _moved_by_the_record(found, best, evidence)
        found = found if best is found.best else settled(replace(found, best=best, steps=(*found.steps[:-1], best)))
        best = found.best
    if any(x.form.shown for x in best.hypothesis.parts):
        return _named_beside(found, forms, most, evidence)
    alone = _freed(found, own, best.hypothesis.own)
    if alone is None:
        return found
    by = found.yardstick
    if best.hypothesis.own is not None:
        alone = _moved_by_the_record(found, alone, evidence)
        needed = cost(alone, by) - cost(best, by) > by.threshold and is_material(alone, best, found, evidence)
    else:
        by = yardstick(found.problem, alone, len(own.free), evidence.confidence)
        needed = not is_enough(found, alone, by, evidence)
        alone = alone if needed else _moved_by_the_record(found, alone, evidence)
    if needed:
        return _named_beside(found, forms, most, evidence)
    alone = _told_as_effects(found, alone, forms)
    return settled(replace(found, best=alone, steps=(found.base, alone), last_ranking=(), yardstick=by))


def _with_a_lag_for_an_effect(found: Found, own: Form, evidence: Evidence) -> Found:
    """Return what was found, with another lag or delay of the model in the place of each effect that may be that.

    A relaxation that is as quick as a longer lag may cancel the model's own one: both are the same model. Where noise
    alone is left with another number of the model too, and the criterion does not favour the effect by far, the
    number is meant.
    """
    lags, best = beside_the_catalogue(own), found.best
    if lags is None or any(x.form.shown for x in best.hypothesis.parts):
        return found
    given = tuple(x.starts[0] for x in lags.free)
    rest = [best.hypothesis.minus(k).freeing(lags, given) for k in range(len(best.hypothesis.parts))]
    fits = [x for x in abreast(lambda x: fit(found.problem, x), rest) if x is not None]
    most = cost(best, found.yardstick) + very_strong(evidence.confidence)
    as_good = [x for x in fits if is_finished(x, found, evidence) and cost(x, found.yardstick) <= most]
    if not as_good:
        return found
    other = _moved_by_the_record(found, min(as_good, key=lambda x: cost(x, found.yardstick)), evidence)
    return settled(replace(found, best=other, steps=(*found.steps[:-1], other)))


def own_first(found: Found, own: Form | None, evidence: Evidence) -> Found | None:
    """Return what the model's own numbers alone explain, as what a search sets out from; None where that is not most.

    A lag or delay of the model that is off looks like effects from afar: a longer lag is a relaxation and a delay.
    What explains less than most of the gap is left to be freed beside the effects that explain more. Another frequency
    and another damping are effects of the catalogue: they stay as given, and are tried as such.

    Args:
        found: the model as given, recalibrated.
        own: frees the numbers.
        evidence: the constants.
    """
    lags = None if own is None else beside_the_catalogue(own)
    if lags is None or only_one_sine(found.problem.observations):
        return None
    alone = _freed(found, lags, None)
    if alone is None:
        return None
    by = yardstick(found.problem, alone, len(lags.free), evidence.confidence)
    if not (is_enough(found, alone, by, evidence) and removes_most(found.base, alone, found, evidence)):
        return None
    alone = _moved_by_the_record(found, alone, evidence)
    return settled(replace(found, best=alone, steps=(found.base, alone), yardstick=by))


def likelier(beside_own: Found, beside_given: Found, evidence: Evidence) -> Found:
    """Return which of two findings stands: beside other numbers of the model, or beside those as given.

    Where the criterion does not favour effects of the catalogue by far, the model's own numbers are meant.
    """
    by = beside_own.yardstick
    if cost(beside_own.best, by) - cost(beside_given.best, by) > very_strong(evidence.confidence):
        return beside_given
    return replace(beside_own, ranking=beside_given.ranking)


def _told_as_effects(found: Found, alone: Fitted, forms: Sequence[Form]) -> Fitted:
    """Return the model's own numbers, changed, with another frequency or damping called by its name."""
    own = alone.hypothesis.own
    told = told_as_effects(own, forms) if own is not None else Hypothesis()
    return fit(found.problem, told) or alone if told.parts else alone


def _named_beside(found: Found, forms: Sequence[Form], most: int, evidence: Evidence) -> Found:
    """Return what was found with another frequency or damping of the model, beside effects, called by its name.

    Only where nothing else is left, and each of them passes the tests of an effect: they are recalibrated otherwise. A
    frequency that was freed beside others may have ended at an alias, and a damping may have made up for that.
    """
    best = found.best
    own = best.hypothesis.own
    if own is None or not best.hypothesis.parts or not is_finished(best, found, evidence):
        return found
    told = told_as_effects(own, forms)
    # an effect of the same name, beside the number that it changes, is the same change in two parts
    kept = tuple(x for x in best.hypothesis.parts if x.form.effect not in told.effects)
    hypotheses = [
        Hypothesis((*kept, *parts), told.own)
        for count in range(len(told.parts), 0, -1)
        for parts in combinations(told.parts, count)
    ]
    fits = [at_aliases(found.problem, x) for x in (fit(found.problem, y) for y in hypotheses) if x is not None]
    named = min(fits, key=lambda x: cost(x, found.yardstick), default=None)
    if named is None or cost(named, found.yardstick) - cost(best, found.yardstick) > found.yardstick.threshold:
        return found
    sure = certain(replace(found, best=named, steps=(*found.steps, named)), evidence, forms, most)
    return sure if {x.form.effect for x in kept} < set(sure.best.hypothesis.effects) else found


def _freed(found: Found, own: Form, known: Part | None) -> Fitted | None:
    """Return the model's own numbers fitted without any effect, from where it has them and from where they were."""
    hypotheses = [Hypothesis().freeing(own, x) for x in _starts(found, own)]
    hypotheses += [Hypothesis(own=known)] if known is not None else []
    fits = abreast(lambda x: fit(found.problem, x), hypotheses)
    return min((x for x in fits if x is not None), key=lambda x: x.training_square, default=None)


def _starts(found: Found, own: Form) -> list[Values]:
    """Return the model's own numbers as given, and with another delay where one promises most.

    From one valley of a delay, a period of the ringing wide, no slope leads to the next.
    """
    given = tuple(x.starts[0] for x in own.free)
    places = [k for k, x in enumerate(own.free) if x.name == OWN_DELAY]
    if not places:
        return [given]
    k, least_s = places[0], own.free[places[0]].low
    form = simple(transport_delay.ID, replace(own.free[k], high=2.0 * own.free[k].high))
    prompt = Hypothesis().freeing(own, (*given[:k], least_s, *given[k + 1 :]))
    valleys = scan_delay(found.problem, prompt, form, DELAYS - 1)
    return [given, *((*given[:k], least_s + x.values[0], *given[k + 1 :]) for x in valleys)]


def _moved_by_the_record(found: Found, fitted: Fitted, evidence: Evidence) -> Fitted:
    """Return a hypothesis with those of the model's own numbers held as given that the record does not move.

    Where structure is left beside effects, the likelihood alone decides: no name depends on these numbers then.
    """
    left = bool(fitted.hypothesis.parts) and not is_finished(fitted, found, evidence)
    while (own := fitted.hypothesis.own) is not None and len(own.values) > 1:
        by = yardstick(found.problem, fitted, len(own.values), evidence.confidence)
        fewer = [x for x in (fit(found.problem, y) for y in _held_as_given(fitted.hypothesis, own)) if x is not None]
        if left:
            idle = [x for x in fewer if cost(x, by) - cost(fitted, by) <= by.threshold]
        else:
            idle = [x for x in fewer if not is_enough(replace(found, best=x), fitted, by, evidence)]
        if not idle:
            break
        fitted = min(idle, key=lambda x: cost(x, by))
    return fitted


def _held_as_given(hypothesis: Hypothesis, own: Part) -> list[Hypothesis]:
    """Return a hypothesis with each of the model's own numbers that are free held as given, in turn."""
    found = []
    for k, free in enumerate(own.form.free):
        form = own.form.holding(free.name, free.starts[0])
        found.append(hypothesis.freeing(form, own.values[:k] + own.values[k + 1 :]))
    return found
