"""The search for missing effects: add one at a time, keep several leaders, look back, stop at the noise."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .criterion import Yardstick, cost, held_gain, yardstick
from .fit import Fitted, fit, judge
from .forms import Form
from .hypothesis import Bench, Hypothesis
from .noise import noise_floor_um
from .outlying import outlying
from .scan import Start
from .scan_special import scan_any

BEAM = 3
MOST_EFFECTS = 3
FITTED_EFFECTS = 8
FITTED_LATER = 4
ROUGH_EVALUATIONS = 4
# a form that is not quite nature's leaves structure that another effect may mop up: one more effect must explain
# most of what is left, or a part of the whole gap that counts
SHARE_OF_REST = 0.5
SHARE_OF_GAP = 0.05

# four standard deviations of a variance estimated on a third of the rows
CHANCE = 4.0
HELD_PART = 3.0
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
    """Set isolated readings aside in every record; returns how many were found."""
    count = 0
    kept = []
    for r, x in zip(fitted.residuals, bench.observations, strict=True):
        found = outlying(x, r, noise_um) & x.usable
        count += int(found.sum())
        kept.append(x.without(found))
    bench.observations = tuple(kept)
    return count


def _starts(bench: Bench, parent: Fitted, forms: Sequence[Form], noise_um: float) -> list[tuple[Form, Start]]:
    found: list[tuple[Form, Start]] = []
    taken = set(parent.hypothesis.effects)
    for form in forms:
        if form.effect not in taken:
            keep = 1 if parent.hypothesis.parts else 2
            found += [(form, start) for start in scan_any(bench, parent.hypothesis, form, noise_um, keep)]
    return sorted(found, key=lambda x: x[1].square)


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
    rows = sum(int(x.training.sum()) for x in bench.observations)
    for leader in leaders:
        effect = leader.hypothesis.effects[-1]
        if effect not in best and len(best) == most:
            continue
        fitted = fit(bench, leader.hypothesis)
        if fitted is None:
            continue
        known = best.get(effect)
        if known is None or _dearer(known, fitted, rows):
            best[effect] = fitted
    return list(best.values())


def _dearer(known: Fitted, other: Fitted, rows: int) -> bool:
    """Return whether the first of two forms of one effect costs more than the second: misfit, and numbers to spend."""
    more = known.hypothesis.free_count - other.hypothesis.free_count
    return rows * math.log(known.training_square / other.training_square) + more * math.log(rows) > 0.0


def look_back(bench: Bench, fitted: Fitted, noise_um: float) -> Fitted:
    """Search again for the values of each effect while the others stand: an early choice may sit in a side valley."""
    for index, part in enumerate(fitted.hypothesis.parts):
        rest = fitted.hypothesis.minus(index)
        for start in scan_any(bench, rest, part.form, noise_um, keep=1):
            again = fit(bench, rest.plus(part.form, start.values))
            if again is not None and again.training_square < 0.999 * fitted.training_square:
                return again
    return fitted


def pruned(bench: Bench, fitted: Fitted, by: Yardstick) -> Fitted:
    """Take out effects that the others have made needless."""
    while len(fitted.hypothesis.parts) > 1:
        without = [fit(bench, fitted.hypothesis.minus(k)) for k in range(len(fitted.hypothesis.parts))]
        alive = [x for x in without if x is not None]
        cheapest = min(alive, key=lambda x: cost(x, by), default=None)
        if cheapest is None or cost(cheapest, by) - cost(fitted, by) > by.threshold:
            return fitted
        fitted = cheapest
    return fitted


def _material(before: Fitted, after: Fitted, base: Fitted, bench: Bench, noise_um: float) -> bool:
    floor = noise_um**2
    gap, rest, left = (max(rms_um(x, bench) ** 2 - floor, 0.0) for x in (base, before, after))
    removed = rest - left
    return removed >= SHARE_OF_REST * rest or removed >= SHARE_OF_GAP * gap


def at_the_floor(fitted: Fitted, bench: Bench, noise_um: float) -> bool:
    """Return whether what is left is noise: its variance exceeds the floor by no more than chance, and it is white."""
    by = yardstick(bench, fitted, 1)
    excess = rms_um(fitted, bench) ** 2 / noise_um**2 - 1.0 if noise_um else math.inf
    chance = CHANCE * math.sqrt(2.0 / by.rows * HELD_PART)
    return excess < chance and by.rows < WHITE * by.effective_rows


def search(bench: Bench, forms: Sequence[Form], progress: Progress | None = None) -> Found:
    """Search for missing effects.

    Raises:
        ValueError: the model as given cannot be simulated under the drive of the records.
    """
    tell = progress or (lambda _: None)
    base = judge(bench, Hypothesis())
    if base is None:
        raise ValueError("the model as given cannot be simulated under the voltage of the record")
    noise = noise_of(base, bench)
    if set_outlying_aside(bench, base, noise):
        base = judge(bench, Hypothesis()) or base
        noise = noise_of(base, bench)
    found = Found(base, base, noise, yardstick(bench, base, 1), steps=[base])
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
        ranked = sorted((Ranked(x, cost(x, by) - cost(found.best, by)) for x in tried), key=lambda x: x.difference)
        if depth == 1:
            found.ranking = ranked
        best = ranked[0].fitted
        gained = held_gain(found.best, best, by)
        enough = ranked[0].difference < -by.threshold and gained > 0.0
        if not enough or not _material(found.best, best, found.base, bench, found.noise_um):
            break
        best = pruned(bench, best, by)
        found = replace(found, best=best, yardstick=by, last_ranking=ranked, steps=[*found.steps, best])
        found.noise_um = min(found.noise_um, noise_of(best, bench))
        set_outlying_aside(bench, best, found.noise_um)
        if at_the_floor(best, bench, found.noise_um):
            break
        beam = _beam(ranked, best)
    return found


def _beam(ranked: list[Ranked], best: Fitted) -> list[Fitted]:
    beam = [best]
    for x in ranked:
        if all(set(x.fitted.hypothesis.effects) != set(y.hypothesis.effects) for y in beam):
            beam.append(x.fitted)
    return beam[:BEAM]
