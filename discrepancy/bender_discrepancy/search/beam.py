"""The search for missing effects: add one at a time, keep several leaders, look back, stop at the noise."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from bender_discrepancy.effects.form import Form
from bender_discrepancy.fitting.criterion import Yardstick, cost, held_gain, yardstick
from bender_discrepancy.fitting.hypothesis import Bench, Hypothesis
from bender_discrepancy.fitting.output_error import Fitted, fit, judge, recounted
from bender_discrepancy.records.observations import only_one_sine
from bender_discrepancy.search.coarse_evidence import shows_in_the_readings
from bender_discrepancy.search.parsimony import simplest_as_good
from bender_discrepancy.search.revise import looked_back
from bender_discrepancy.search.set_aside import cleared, settled
from bender_discrepancy.search.state import Found, Ranked, noise_of, rms_um
from bender_discrepancy.search.step import HOPELESS, LEFT_OVER_NOISE, tried_on

BEAM = 3
MOST_EFFECTS = 3
# turns in which effects are replaced by better ones
MOST_REPLACED = 2
# a form that is not quite nature's leaves structure that another effect may mop up: one more effect must explain
# most of what is left, or a part of the whole gap that counts
SHARE_OF_REST = 0.5
SHARE_OF_GAP = 0.05

# the least rest that another effect is sought in, as a square over the noise's
BESIDE_ANOTHER = 1.0
# times the noise: of a model that leaves so little, others that leave far more are no match
NEARLY_NOISE = 2.0
# standard deviations of a mean square
CHANCE = 4.0
WHITE = 1.2

Progress = Callable[[str], None]
Keep = Callable[["Found"], None]


def replaced(bench: Bench, found: Found, forms: Sequence[Form]) -> Found:
    """Try every likely effect in every form in the place of each one of the best hypothesis, while the others stand.

    Likely are those that led at the first step or at the last one. What was tried joins the last ranking: an early
    choice has rivals as the last one has.
    """
    by, ranked = found.yardstick, found.last_ranking
    best = found.best
    likely = {x.fitted.hypothesis.effects[-1] for x in [*found.ranking, *ranked]} | set(best.hypothesis.effects)
    forms = [x for x in forms if x.effect in likely]
    for _ in range(MOST_REPLACED):
        tried: list[Fitted] = []
        for k in range(len(best.hypothesis.parts)):
            rest = judge(bench, best.hypothesis.minus(k))
            tried += [] if rest is None else tried_on(bench, rest, forms, found.noise_um, [best])
        ranked = _ranked([best, *tried, *(x.fitted for x in ranked)], found.steps[-2], by)
        first = simplest_as_good([x.fitted for x in ranked], found.base)
        if _form_names(first) == _form_names(best):
            break
        best = first
    return replace(found, best=best, last_ranking=ranked, steps=[*found.steps[:-1], best])


def pruned(bench: Bench, fitted: Fitted, found: Found, by: Yardstick) -> Fitted:
    """Take out effects that the others have made needless: no evidence is lost, or nothing that matters."""
    while len(fitted.hypothesis.parts) > 1:
        without = [fit(bench, fitted.hypothesis.minus(k)) for k in range(len(fitted.hypothesis.parts))]
        alive = [x for x in without if x is not None]
        cheapest = min(alive, key=lambda x: cost(x, by), default=None)
        if cheapest is None:
            return fitted
        lost = cost(cheapest, by) - cost(fitted, by) > by.threshold
        if lost and _material(cheapest, fitted, found.base, bench, found.noise_um):
            return fitted
        fitted = cheapest
    return fitted


def _material(before: Fitted, after: Fitted, base: Fitted, bench: Bench, noise_um: float) -> bool:
    floor = noise_um**2
    gap, rest, left = (max(rms_um(x, bench) ** 2 - floor, 0.0) for x in (base, before, after))
    if rest <= _least_rest(before) * floor:
        return False
    removed = rest - left
    return removed >= SHARE_OF_REST * rest or removed >= SHARE_OF_GAP * gap


def _least_rest(fitted: Fitted) -> float:
    """Return the least square, over that of the noise, for which one more effect is named.

    Beside an effect that was found, the rest may be what its form leaves of nature's: another one must be as large as
    the noise.
    """
    return BESIDE_ANOTHER if fitted.hypothesis.parts else LEFT_OVER_NOISE**2 - 1.0


def at_the_floor(fitted: Fitted, bench: Bench, noise_um: float) -> bool:
    """Return whether what is left is noise: white, its mean square above the floor by no more than chance."""
    by = yardstick(bench, fitted, 1)
    squares = np.concatenate([r[x.judging] ** 2 for r, x in zip(fitted.residuals, bench.observations, strict=True)])
    chance = CHANCE * float(np.std(squares)) / math.sqrt(max(squares.size, 1))
    return float(np.mean(squares)) - noise_um**2 < chance and by.rows < WHITE * by.effective_rows


def _finished(found: Found, bench: Bench) -> bool:
    little = rms_um(found.best, bench) ** 2 < (1.0 + _least_rest(found.best)) * found.noise_um**2
    return little or at_the_floor(found.best, bench, found.noise_um)


def _says_no_more(found: Found, bench: Bench) -> bool:
    """Return whether records of one frequency at one amplitude have shown a memory: what is left has no name."""
    return any(x.form.memory for x in found.best.hypothesis.parts) and only_one_sine(bench.observations)


def search(bench: Bench, forms: Sequence[Form], progress: Progress | None = None, keep: Keep | None = None) -> Found:
    """Search for missing effects; `keep` gets what was found so far, after the first ranking and after every step.

    Raises:
        ValueError: the model as given cannot be simulated under the drive of the records.
    """
    tell, hand_over = progress or (lambda _: None), keep or (lambda _: None)
    base = judge(bench, Hypothesis())
    if base is None:
        raise ValueError("the model as given cannot be simulated under the voltage of the record")
    found = settled(bench, Found(base, base, noise_of(base, bench), yardstick(bench, base, 1), steps=[base]))
    found.base = found.best
    base = found.best
    beam = [base]
    for depth in range(1, MOST_EFFECTS + 1):
        tell(f"step {depth}: trying {len(forms)} forms on {len(beam)} model{'s' * (len(beam) > 1)}")
        tried = _tried_on_all(bench, beam, forms, found.noise_um)
        if not tried:
            break
        leader = min(tried, key=lambda x: x.training_square)
        if depth > 1:
            leader = looked_back(bench, leader, forms, found.noise_um)
            tried.append(leader)
        found, tried, leader = cleared(bench, found, tried, leader)
        by = yardstick(bench, leader, 20 * len(forms))
        ranked = _ranked(tried, found.best, by)
        if depth == 1:
            found.ranking = ranked
            hand_over(found)
        best = simplest_as_good([x.fitted for x in ranked], found.base)
        gained = held_gain(found.best, best, by)
        enough = cost(best, by) - cost(found.best, by) < -by.threshold and gained > 0.0
        enough = enough and shows_in_the_readings(bench, found.best, best)
        if not enough or not _material(found.best, best, found.base, bench, found.noise_um):
            if depth > 1 or _finished(found, bench):
                found = settled(bench, found)
                break
            # one effect alone may explain little where two are missing: pairs are tried among the leaders
            beam = _beam(ranked[1:], ranked[0].fitted)
            continue
        found = _accepted(bench, replace(found, yardstick=by, last_ranking=ranked), best, forms, tell)
        hand_over(found)
        if _finished(found, bench) or _says_no_more(found, bench):
            break
        beam = _beam(found.last_ranking, found.best)
    return found


def _tried_on_all(bench: Bench, beam: Sequence[Fitted], forms: Sequence[Form], noise_um: float) -> list[Fitted]:
    """Try the effects on one model after the other, until one leaves noise alone.

    Where the first one nearly does, those that leave far more are not built upon.
    """
    tried: list[Fitted] = []
    least = beam[0].training_square
    nearly_noise = rms_um(beam[0], bench, held=False) < NEARLY_NOISE * noise_um
    for parent in beam:
        if nearly_noise and parent.training_square > HOPELESS * least:
            continue
        tried += tried_on(bench, parent, forms, noise_um, tried)
        if any(rms_um(x, bench, held=False) < LEFT_OVER_NOISE * noise_um for x in tried):
            break
    return tried


def _accepted(bench: Bench, found: Found, best: Fitted, forms: Sequence[Form], tell: Progress) -> Found:
    """Return what was found with one more effect: needless ones taken out, early ones replaced by better ones."""
    by, before = found.yardstick, found.steps[-1]
    best = pruned(bench, best, found, by)
    found = replace(found, best=best, steps=[*found.steps, best])
    if len(best.hypothesis.parts) > 1:
        tell("trying others in the place of each")
        found = replaced(bench, found, forms)
        best = pruned(bench, found.best, found, by)
        found = replace(found, best=best, steps=[*found.steps[:-1], best])
    found = settled(bench, found)
    found.last_ranking = _ranked([recounted(x.fitted, bench) for x in found.last_ranking], before, by)
    return found


def _form_names(fitted: Fitted) -> frozenset[str]:
    return frozenset(part.form.name for part in fitted.hypothesis.parts)


def _ranked(tried: Sequence[Fitted], before: Fitted, by: Yardstick) -> list[Ranked]:
    """Return hypotheses with the criterion's difference to the one before, best first, each set of forms once."""
    ranked = sorted((Ranked(x, cost(x, by) - cost(before, by)) for x in tried), key=lambda x: x.difference)
    once: dict[frozenset[str], Ranked] = {}
    for x in ranked:
        once.setdefault(_form_names(x.fitted), x)
    return list(once.values())


def _beam(ranked: list[Ranked], best: Fitted) -> list[Fitted]:
    beam = [best]
    for x in ranked:
        if all(set(x.fitted.hypothesis.effects) != set(y.hypothesis.effects) for y in beam):
            beam.append(x.fitted)
    return beam[:BEAM]
