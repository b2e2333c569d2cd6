"""The search for missing effects: add one at a time, keep several leaders, look back, stop at the noise."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .criterion import Yardstick, cost, held_gain, price, yardstick
from .fit import Fitted, fit, judge, recounted
from .forms import Form
from .hypothesis import Bench, Hypothesis
from .noise import noise_floor_um
from .outlying import outlying
from .parsimony import simplest_as_good
from .scan import Start
from .scan_special import scan_any

BEAM = 3
MOST_EFFECTS = 3
# effects that are fitted roughly, and then to the end: on the model as given, and on one with an effect in it
ROUGH_EFFECTS, FITTED_EFFECTS = 14, 8
ROUGH_LATER, FITTED_LATER = 8, 4
MOST_STARTS = 3
READINGS_PER_NUMBER = 4
MOST_FORMS = 2
ROUGH_EVALUATIONS = 4
# a form that is not quite nature's leaves structure that another effect may mop up: one more effect must explain
# most of what is left, or a part of the whole gap that counts
SHARE_OF_REST = 0.5
SHARE_OF_GAP = 0.05

# where so little is left, nothing more is named: a form of the catalogue is not nature's to the last percent
LEFT_OVER_NOISE = 1.2
# standard deviations of a mean square
CHANCE = 4.0
WHITE = 1.2

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Ranked:
    """A hypothesis that was tried on top of another, with the criterion's difference to it (negative: better)."""

    fitted: Fitted
    difference: float


@dataclass(slots=True, eq=False)
class Found:
    """What a search found.

    Attributes:
        base: the model as given, recalibrated.
        best: the hypothesis that stands at the end.
        noise_um: noise floor.
        ranking: hypotheses tried at the first step, best first.
        last_ranking: hypotheses tried at the step that decided the last effect, best first.
        steps: the best hypothesis after every step, base first.
        yardstick: what differences were weighed with at the end.
    """

    base: Fitted
    best: Fitted
    noise_um: float
    yardstick: Yardstick
    ranking: list[Ranked] = field(default_factory=list)
    last_ranking: list[Ranked] = field(default_factory=list)
    steps: list[Fitted] = field(default_factory=list)


def rms_um(fitted: Fitted, bench: Bench, held: bool = True) -> float:
    """Return the rms of a hypothesis on the held-out rows, or on those of the fit."""
    rows = sum(int((x.judging if held else x.training).sum()) for x in bench.observations)
    square = fitted.held_square if held else fitted.training_square
    return math.sqrt(square / max(rows, 1))


def noise_of(fitted: Fitted, bench: Bench) -> float:
    """Return the noise floor that a residual shows, the smallest of all records weighed by their rows."""
    squares = [
        (noise_floor_um(np.nan_to_num(r), x.usable) ** 2, int(x.usable.sum()))
        for r, x in zip(fitted.residuals, bench.observations, strict=True)
    ]
    return math.sqrt(sum(s * n for s, n in squares) / sum(n for _, n in squares))


def set_outlying_aside(bench: Bench, fitted: Fitted, noise_um: float) -> int:
    """Set isolated readings aside in every record, and take others back; returns how many changed."""
    changed = 0
    kept = []
    for r, x in zip(fitted.residuals, bench.observations, strict=True):
        whole = replace(x, usable=np.isfinite(x.measured_um))
        after = whole.without(outlying(whole, r, noise_um))
        changed += int(np.count_nonzero(after.usable != x.usable))
        kept.append(after)
    bench.observations = tuple(kept)
    return changed


def _starts(bench: Bench, parent: Fitted, forms: Sequence[Form], noise_um: float) -> list[tuple[Form, Start]]:
    found: list[tuple[Form, Start]] = []
    taken = set(parent.hypothesis.effects)
    rows = sum(int(x.training.sum()) for x in bench.observations)
    for form in forms:
        if form.effect not in taken and READINGS_PER_NUMBER * len(form.free) <= rows:
            keep = 1 if parent.hypothesis.parts else 2
            found += [(form, start) for start in scan_any(bench, parent.hypothesis, form, noise_um, keep)]
    most = ROUGH_LATER if parent.hypothesis.parts else ROUGH_EFFECTS
    return _leading(sorted(found, key=lambda x: x[1].square), most)


def _leading(starts: list[tuple[Form, Start]], most: int) -> list[tuple[Form, Start]]:
    """Return the best starts of the effects that promise most."""
    kept: dict[str, int] = {}
    found = []
    for form, start in starts:
        if form.effect not in kept and len(kept) == most:
            continue
        kept[form.effect] = kept.get(form.effect, 0) + 1
        if kept[form.effect] <= MOST_STARTS:
            found.append((form, start))
    return found


def _roughly(bench: Bench, parent: Fitted, starts: list[tuple[Form, Start]]) -> dict[str, list[Fitted]]:
    """Fit every start in a few rough steps; returns per form the fits, best first."""
    found: dict[str, list[Fitted]] = {}
    for form, start in starts:
        fitted = fit(bench, parent.hypothesis.plus(form, start.values), ROUGH_EVALUATIONS, roughly=True)
        if fitted is not None:
            found.setdefault(form.name, []).append(fitted)
    for fits in found.values():
        fits.sort(key=lambda x: x.training_square)
    return found


def _tried(bench: Bench, parent: Fitted, forms: Sequence[Form], noise_um: float) -> list[Fitted]:
    """Fit the most promising effects on top of a hypothesis; one per effect is returned, each in its best form."""
    most = FITTED_LATER if parent.hypothesis.parts else FITTED_EFFECTS
    rough = _roughly(bench, parent, _starts(bench, parent, forms, noise_um))
    leaders = sorted((fits[0] for fits in rough.values()), key=lambda x: x.training_square)
    best: dict[str, Fitted] = {}
    forms_of: dict[str, int] = {}
    rows = sum(int(x.training.sum()) for x in bench.observations)
    for leader in leaders:
        effect = leader.hypothesis.effects[-1]
        if (effect not in best and len(best) == most) or forms_of.get(effect, 0) == MOST_FORMS:
            continue
        forms_of[effect] = forms_of.get(effect, 0) + 1
        fitted = fit(bench, leader.hypothesis)
        if fitted is None:
            continue
        known = best.get(effect)
        if known is None or _dearer(known, fitted, rows):
            best[effect] = fitted
    return list(best.values())


def _dearer(known: Fitted, other: Fitted, rows: int) -> bool:
    """Return whether the first of two forms of one effect costs more than the second: misfit, and numbers to spend."""
    prices = [price(x.hypothesis.free_count, rows) for x in (known, other)]
    if math.isinf(prices[1]):
        return False
    return rows * math.log(known.training_square / other.training_square) + prices[0] - prices[1] > 0.0


def look_back(bench: Bench, fitted: Fitted, noise_um: float) -> Fitted:
    """Search again for the values of each effect while the others stand: an early choice may sit in a side valley."""
    for index, part in enumerate(fitted.hypothesis.parts):
        rest = fitted.hypothesis.minus(index)
        for start in scan_any(bench, rest, part.form, noise_um, keep=1):
            again = fit(bench, rest.plus(part.form, start.values))
            if again is not None and again.training_square < 0.999 * fitted.training_square:
                return again
    return fitted


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
    if rest <= (LEFT_OVER_NOISE**2 - 1.0) * floor:
        return False
    removed = rest - left
    return removed >= SHARE_OF_REST * rest or removed >= SHARE_OF_GAP * gap


def at_the_floor(fitted: Fitted, bench: Bench, noise_um: float) -> bool:
    """Return whether what is left is noise: white, its mean square above the floor by no more than chance."""
    by = yardstick(bench, fitted, 1)
    squares = np.concatenate([r[x.judging] ** 2 for r, x in zip(fitted.residuals, bench.observations, strict=True)])
    chance = CHANCE * float(np.std(squares)) / math.sqrt(max(squares.size, 1))
    return float(np.mean(squares)) - noise_um**2 < chance and by.rows < WHITE * by.effective_rows


def _settled(bench: Bench, found: Found) -> Found:
    """Set outlying readings aside by what the best hypothesis leaves, and count everything anew without them."""
    best = found.best
    if set_outlying_aside(bench, best, found.noise_um):
        best = fit(bench, best.hypothesis) or best
    found.noise_um = min(found.noise_um, noise_of(best, bench))
    best = recounted(best, bench)
    steps = [*(recounted(x, bench) for x in found.steps[:-1]), best]
    return replace(found, base=recounted(found.base, bench), best=best, steps=steps)


def _finished(found: Found, bench: Bench) -> bool:
    little = rms_um(found.best, bench) < LEFT_OVER_NOISE * found.noise_um
    return little or at_the_floor(found.best, bench, found.noise_um)


def search(bench: Bench, forms: Sequence[Form], progress: Progress | None = None) -> Found:
    """Search for missing effects.

    Raises:
        ValueError: the model as given cannot be simulated under the drive of the records.
    """
    tell = progress or (lambda _: None)
    base = judge(bench, Hypothesis())
    if base is None:
        raise ValueError("the model as given cannot be simulated under the voltage of the record")
    found = _settled(bench, Found(base, base, noise_of(base, bench), yardstick(bench, base, 1), steps=[base]))
    found.base = found.best
    base = found.best
    beam = [base]
    for depth in range(1, MOST_EFFECTS + 1):
        tell(f"step {depth}: trying {len(forms)} forms on {len(beam)} model{'s' * (len(beam) > 1)}")
        tried = [x for parent in beam for x in _tried(bench, parent, forms, found.noise_um)]
        if not tried:
            break
        leader = min(tried, key=lambda x: x.training_square)
        if depth > 1:
            leader = look_back(bench, leader, found.noise_um)
            tried.append(leader)
        by = yardstick(bench, leader, 20 * len(forms))
        ranked = _ranked(tried, found.best, by)
        if depth == 1:
            found.ranking = ranked
        best = simplest_as_good([x.fitted for x in ranked], found.base)
        gained = held_gain(found.best, best, by)
        enough = cost(best, by) - cost(found.best, by) < -by.threshold and gained > 0.0
        if not enough or not _material(found.best, best, found.base, bench, found.noise_um):
            break
        best = pruned(bench, best, found, by)
        found = replace(found, best=best, yardstick=by, last_ranking=ranked, steps=[*found.steps, best])
        found = _settled(bench, found)
        found.last_ranking = _ranked([recounted(x.fitted, bench) for x in ranked], found.steps[-2], by)
        if _finished(found, bench):
            break
        beam = _beam(found.last_ranking, found.best)
    return found


def _ranked(tried: Sequence[Fitted], before: Fitted, by: Yardstick) -> list[Ranked]:
    """Return hypotheses with the criterion's difference to the one before, best first."""
    return sorted((Ranked(x, cost(x, by) - cost(before, by)) for x in tried), key=lambda x: x.difference)


def _beam(ranked: list[Ranked], best: Fitted) -> list[Fitted]:
    beam = [best]
    for x in ranked:
        if all(set(x.fitted.hypothesis.effects) != set(y.hypothesis.effects) for y in beam):
            beam.append(x.fitted)
    return beam[:BEAM]
