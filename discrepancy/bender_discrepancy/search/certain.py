"""Only what is certain stands beside others: each effect is taken out once more, and the others are fitted again.

On which side of a plant a lag acts is certain only where the plant is not linear.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations

from bender_compiled.abreast import abreast
from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.effects.form import Form, simple
from bender_discrepancy.fitting.blocked import doubtful
from bender_discrepancy.fitting.criterion import cost, very_strong
from bender_discrepancy.fitting.hypothesis import Hypothesis, Part
from bender_discrepancy.fitting.output_error import Fitted, fit, judge
from bender_discrepancy.records.observations import turns_plays
from bender_discrepancy.search.budget import BUDGET
from bender_discrepancy.search.evidence import (
    EVIDENCE,
    Evidence,
    energy_at_floor,
    exceeds_the_noise,
    is_material,
    may_be_mopped_up,
)
from bender_discrepancy.search.set_aside import settled
from bender_discrepancy.search.state import Found, Ranked
from bender_discrepancy.search.step import at_aliases, rings_away, tried_on, with_another_form
from bender_plant.blocks import tip_mass, transport_delay

OTHER_SIDE = {"source_resistance": "sensor_lag", "sensor_lag": "source_resistance"}
LEAVE_NO_SIDE = frozenset({
    "transport_delay", "charge_leakage", "creep", "second_mode", "tip_mass", "structural_damping",
    "thermal_drift", "periodic_disturbance", "ageing", "supply_quantisation", *OTHER_SIDE,
})  # fmt: skip
"""Effects whose equations superpose, and equal steps of the command, which have no other form: where a lag acts beside
them, no form of theirs leaves what has a side."""
MAKES_UP_FOR_AN_ALIAS = frozenset({"structural_damping", "transport_delay", *OTHER_SIDE})
SPLITS = (0.1, 0.5, 0.9)
"""Of a delay, the part that one of two lags sets out with."""
AS_GIVEN = (1.0,)
"""The ratio of another frequency to the model's from which it is sought."""
AT_END = 1.01
"""Times the lower end of a range: a fit that ended there."""


def certain(found: Found, by: Evidence = EVIDENCE, forms: Sequence[Form] = (), most: int = BUDGET.effects) -> Found:
    """Return what was found without the effects that are not certain.

    First, two effects take the place of a delay where they fit far better, and a curve that of a loop beside a curve
    where the loop removes little. No effect stands beside others that is quicker than a record can tell from its
    beginning, or slower than one that comes back. One that stands alone is left to the verdict: there may be no other
    block that holds what shows it.

    Args:
        found: by a step of the search.
        by: the constants.
        forms: that were sought.
        most: effects in one hypothesis.
    """
    begun = found
    if len(found.best.hypothesis.parts) < most:
        found = _with_two_for_a_delay(found, by, forms)
    best = _without_its_loop(found, by, forms) or found.best
    while len(best.hypothesis.parts) > 1:
        ended = next((k for k, x in enumerate(best.hypothesis.parts) if at_its_end(x)), None)
        if ended is not None:
            without = fit(found.problem, best.hypothesis.minus(ended))
            if without is None:
                break
            best = without
            continue
        unsure = _as_one(found, best, forms) or _unsure(found, best, by, forms)
        if not unsure:
            break
        best = min(unsure, key=lambda x: x.training_square)
    if best is begun.best:
        return found
    best = fit(found.problem, best.hypothesis) or best
    effects = set(best.hypothesis.effects)
    steps = [x for x in found.steps if set(x.hypothesis.effects) < effects]
    return settled(replace(found, best=best, steps=(*steps, best)))


def _with_two_for_a_delay(found: Found, by: Evidence, forms: Sequence[Form]) -> Found:
    """Return what was found with two effects in the place of a delay, where they fit far better.

    Two short lags are late by their sum, and even rows show a ringing at its alias late as a delay does. Either of two
    lags alone, and a lag without the other frequency, fits worse than that delay, so that no search which puts one
    effect in the place of another comes to them.
    """
    best, problem = found.best, found.problem
    plain = {x.name: x for x in forms}
    lags = [plain[x] for x in OTHER_SIDE if x in plain]
    known = {*best.hypothesis.effects, *(x.id for x in problem.base.blocks)}
    delays = [
        k for k, x in enumerate(best.hypothesis.parts) if x.form.effect == transport_delay.ID and not x.form.shown
    ]
    if len(lags) < len(OTHER_SIDE) or known & set(OTHER_SIDE) or not delays:
        return found
    if energy_at_floor(best, problem, found.noise_um, by.confidence):
        return found
    (delay_s, *_), rest = best.hypothesis.parts[delays[0]].values, best.hypothesis.minus(delays[0])
    first, second = lags
    two_lags = [rest.plus(first, (x * delay_s,)).plus(second, ((1.0 - x) * delay_s,)) for x in SPLITS]
    fits = [_fitted_from(two_lags, found, best)]
    frequency = plain.get(tip_mass.ID)
    if frequency is not None and tip_mass.ID not in known:
        # the model's own frequency, freed beside the delay, is at the alias that the delay makes up for
        given = replace(rest, own=None)
        rings = [given.plus(x, (SPLITS[1] * delay_s,)).plus(frequency, AS_GIVEN) for x in lags]
        fits += [at_aliases(problem, x) for x in (fit(problem, y) for y in rings) if x is not None]
    fitted = min((x for x in fits if x is not None), key=lambda x: cost(x, found.yardstick), default=None)
    if fitted is None or cost(best, found.yardstick) - cost(fitted, found.yardstick) <= very_strong(by.confidence):
        return found
    return replace(found, best=fitted, steps=(*found.steps[:-1], fitted))


def _without_its_loop(found: Found, by: Evidence, forms: Sequence[Form]) -> Fitted | None:
    """Return what was found with a curve in the place of a loop beside a curve, where it is not certain; else None.

    The loop is one effect more than the curve, and has to remove as much as any further effect.
    """
    best, problem = found.best, found.problem
    if not turns_plays(problem.observations):
        return None
    for k, part in enumerate(best.hypothesis.parts):
        curves = [x for x in forms if x.effect == part.form.beside and x.effect not in best.hypothesis.effects]
        rest = judge(problem, best.hypothesis.minus(k)) if curves and not part.form.shown else None
        tried = [] if rest is None else tried_on(found, rest, curves, ())
        alone = [x for x in tried if not is_material(x, best, found, by)]
        if alone:
            return min(alone, key=lambda x: x.training_square)
    return None


def with_lags_moved(found: Found, by: Evidence = EVIDENCE) -> Found:
    """Return what was found, and among what was tried each of its lags on the other side of the plant.

    The step that decided the last effect has not tried that where its choice was taken back to fewer effects, nor
    where the lag came before effects that change its side. Where the other side is better by far, it is the one found;
    what was found is its rival then. A side that another channel of the records shows, or excludes, was never open.
    """
    ranked = list(found.last_ranking)
    best, present = found.best.hypothesis, {x.id for x in found.problem.base.blocks}
    for k, part in enumerate(best.parts):
        other = OTHER_SIDE.get(part.form.effect, "")
        if other not in found.led or other in present or other in best.effects or part.form.shown:
            continue
        name = part.form.name.replace(part.form.effect, other)
        moved = best.minus(k).plus(simple(other, *part.form.free, memory=True, name=name), part.values)
        if any(set(x.fitted.hypothesis.effects) == set(moved.effects) for x in ranked):
            continue
        fitted = _fitted_from([moved], found, found.best)
        if fitted is None:
            continue
        ranked.append(_ranked(fitted, found))
        if cost(found.best, found.yardstick) - cost(fitted, found.yardstick) > very_strong(by.confidence):
            ranked += [] if any(x.fitted is found.best for x in ranked) else [_ranked(found.best, found)]
            changed = replace(found, best=fitted, last_ranking=tuple(ranked), steps=(*found.steps[:-1], fitted))
            return with_lags_moved(changed, by)
    return replace(found, last_ranking=tuple(ranked))


def _ranked(fitted: Fitted, found: Found) -> Ranked:
    return Ranked(fitted, cost(fitted, found.yardstick) - cost(found.base, found.yardstick))


def lags_commute(found: Found, by: Evidence = EVIDENCE) -> bool:
    """Return whether two lags, on either side of the plant, fit as well with each other's time constants.

    The plant between them is linear then, as far as the records show, and both may as well be on one side.
    """
    best = found.best.hypothesis
    if not OTHER_SIDE.keys() <= set(best.effects) or any(x.form.shown for x in best.parts):
        return False
    first = {x.form.effect: x.values[:1] for x in best.parts}
    exchanged = (
        replace(x, values=first[OTHER_SIDE.get(x.form.effect, x.form.effect)] + x.values[1:]) for x in best.parts
    )
    other = judge(found.problem, replace(best, parts=tuple(exchanged)))
    return other is not None and cost(other, found.yardstick) - cost(found.best, found.yardstick) < very_strong(
        by.confidence
    )


def _unsure(found: Found, best: Fitted, by: Evidence, forms: Sequence[Form]) -> list[Fitted]:
    """Return hypotheses without one effect that would not be named again, or may only fit the residual of others."""
    rest = [best.hypothesis.minus(k) for k, x in enumerate(best.hypothesis.parts) if not x.form.shown]
    fits = abreast(lambda x: _fitted_without(found, x, best), rest)
    shorter = [x for x in fits if x is not None]
    mopping = [x for x in shorter if may_be_mopped_up(x, best, found, by) and not _is_needed(found, x, best, by, forms)]
    return mopping or doubtful(found.problem, best, shorter)


def _is_needed(found: Found, without: Fitted, best: Fitted, by: Evidence, forms: Sequence[Form]) -> bool:
    """Return whether noise alone is left with an effect, and much more without it, whatever forms the others take.

    What the form of another effect leaves is hardly ever all that a further effect could take, and other forms take it
    as well.
    """
    if not energy_at_floor(best, found.problem, found.noise_um, by.confidence):
        return False
    for index in range(len(without.hypothesis.parts)):
        if not exceeds_the_noise(without, found, by):
            return False
        without = with_another_form(found.problem, without, index, forms, found.noise_um) or without
    return exceeds_the_noise(without, found, by)


def _as_one(found: Found, best: Fitted, forms: Sequence[Form]) -> list[Fitted]:
    """Return hypotheses without one effect that fit as well with another one, at the same place, in a wider form.

    A loop beside a curve is one form of hysteresis: no record tells it from a loop and an effect that is that curve.
    """
    hypothesis, base = best.hypothesis, found.problem.base
    tried: list[Hypothesis] = []
    for (k, part), (j, other) in permutations(enumerate(hypothesis.parts), 2):
        if part.form.shown or EFFECTS[part.form.effect].stage != EFFECTS[other.form.effect].stage:
            continue
        known = dict(zip((x.name for x in other.form.free), other.values, strict=True))
        for form in forms:
            if form.effect != other.form.effect or form == other.form or not form.contains(other.form, base):
                continue
            # what a scale adds is least at its lower end; nought has no logarithm
            wider = Part(form, tuple(known.get(x.name, x.low if x.log else 0.0) for x in form.free))
            placed = replace(hypothesis, parts=(*hypothesis.parts[:j], wider, *hypothesis.parts[j + 1 :]))
            tried.append(placed.minus(k))
    fits = abreast(lambda x: fit(found.problem, x), tried)
    by = found.yardstick
    return [x for x in fits if x is not None and cost(x, by) - cost(best, by) <= by.threshold]


def _fitted_without(found: Found, rest: Hypothesis, best: Fitted) -> Fitted | None:
    """Fit a hypothesis without one effect: to the end where it may come near the one with it.

    A lag makes up for most of what a delay misses that is off by a period of the ringing: without the lag, the delay
    may belong elsewhere. So may a frequency at an alias, without what made up for its phase or its decay.
    """
    fitted = _fitted_from([rest, *rings_away(found.problem, rest)], found, best)
    taken_out = set(best.hypothesis.effects) - set(rest.effects)
    return fitted if fitted is None or taken_out - MAKES_UP_FOR_AN_ALIAS else at_aliases(found.problem, fitted)


def _fitted_from(starts: Sequence[Hypothesis], found: Found, best: Fitted) -> Fitted | None:
    fits = [x for x in (fit(found.problem, y, BUDGET.certified) for y in starts) if x is not None]
    fitted = min(fits, key=lambda x: x.training_square, default=None)
    if fitted is None or fitted.training_square > BUDGET.hopeless * best.training_square:
        return fitted
    return fit(found.problem, fitted.hypothesis)


def at_its_end(part: Part) -> bool:
    """Return whether the time scale of surroundings ended at the lower end of what a record of that length shows."""
    if EFFECTS[part.form.effect].stage != "surroundings":
        return False
    scales = [(x, v) for x, v in zip(part.form.free, part.values, strict=True) if x.low > 0.0 and not x.solved]
    return any(x.name in ("time_constant_s", "frequency_Hz") and v <= x.low * AT_END for x, v in scales)
