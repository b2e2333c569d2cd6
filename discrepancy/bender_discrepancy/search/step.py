"""One step of the search: every effect is tried on top of a hypothesis, roughly first, the leaders to the end."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np

from bender_compiled.abreast import abreast
from bender_discrepancy.effects.catalogue import EFFECTS
from bender_discrepancy.effects.form import Form
from bender_discrepancy.fitting.criterion import price
from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.hypothesis import Hypothesis, Part
from bender_discrepancy.fitting.output_error import Fitted, fit, judge
from bender_discrepancy.fitting.own_numbers import OWN_DELAY, first_mode, names_of
from bender_discrepancy.fitting.scans.chosen import scan_any
from bender_discrepancy.fitting.standing import Standing, standing
from bender_discrepancy.fitting.starts import Start
from bender_discrepancy.records.observations import only_one_sine
from bender_discrepancy.records.ringing import first_resonance
from bender_discrepancy.records.spectrum import are_even
from bender_discrepancy.search.budget import BUDGET
from bender_discrepancy.search.evidence import EVIDENCE
from bender_discrepancy.search.state import Found
from bender_plant.blocks import tip_mass

_OF_THE_STRUCTURE = frozenset(name for name, effect in EFFECTS.items() if effect.stage == "structure")
ELSEWHERE = 0.05
"""Of a number: a valley of the misfit is wider, as a rule."""
BETTER, NEARLY, FORMS_TRIED = 0.97, 2.0, 2
"""Another form of an effect leaves at most this part of the square; a rough fit that leaves so many times as much is
not fitted to the end; so many forms are fitted."""
ALIASES_TRIED = 12
RINGS = (-2, -1, 1, 2)
"""Periods of the first mode by which a delay is tried elsewhere."""
DELAY_NAMES = ("delay_s", OWN_DELAY)
FEW = 4
"""Numbers of a hypothesis that is fitted beside the next one: the slopes by more keep the cores busy."""


def _starts(
    problem: FitProblem, parent: Fitted, forms: Sequence[Form], noise_um: float, beside: Standing
) -> list[tuple[Form, Start]]:
    # beside a number of the model that is free, an effect that is another one of the same is the same change
    taken = {*parent.hypothesis.effects, *names_of(parent.hypothesis.own)}
    rows = sum(int(x.training.sum()) for x in problem.observations)
    scanned = [x for x in forms if x.effect not in taken and BUDGET.readings_per_number * len(x.free) <= rows]

    def scans(forms: Sequence[Form], keep: int) -> list[list[Start]]:
        # what changes the ringing takes longest: no core waits for it in the end
        order = sorted(range(len(forms)), key=lambda k: forms[k].effect not in _OF_THE_STRUCTURE)
        found = abreast(lambda k: scan_any(problem, parent.hypothesis, forms[k], noise_um, keep, beside), order)
        return [starts for _, starts in sorted(zip(order, found, strict=True), key=lambda x: x[0])]

    names = {x.name for x in scanned}
    first = [x for x in scanned if x.refines not in names]
    promising = dict(zip([x.name for x in first], scans(first, BUDGET.valleys), strict=True))
    while later := [x for x in scanned if x.name not in promising and x.refines in promising]:
        # each start of the plainer form lies in a valley of its own
        near = [(x, x.setting_out_from([start.values])) for x in later for start in promising[x.refines]]
        promising |= {x.name: [] for x in later}
        for (form, _), best in zip(near, scans([x for _, x in near], 1), strict=True):
            promising[form.name] += best
    found = [(form, start) for form in scanned for start in promising[form.name]]
    most = BUDGET.rough_later if parent.hypothesis.parts else BUDGET.rough_first
    if only_one_sine(problem.observations):
        most = len(forms)
    return _leading(sorted(found, key=lambda x: x[1].square), most)


def _leading(starts: list[tuple[Form, Start]], most: int) -> list[tuple[Form, Start]]:
    """Return the best starts of the effects that promise most.

    A start that was solved for in all its numbers promises what a fit will find, another one less; one of a form that
    refines another promises more than its plainer one in the same valley. Each kind counts apart.
    """
    kept: dict[str, list[tuple[bool, str]]] = {}
    found = []
    for form, start in starts:
        if form.effect not in kept and len(kept) == most:
            continue
        kinds = kept.setdefault(form.effect, [])
        kinds.append((_is_solved(form), form.name if form.refines else ""))
        if kinds.count(kinds[-1]) <= BUDGET.starts:
            found.append((form, start))
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _Rough:
    """A hypothesis after a rough fit and the sum of squares on the training rows that it promises."""

    hypothesis: Hypothesis
    square: float


def _roughly(
    problem: FitProblem, parent: Fitted, starts: list[tuple[Form, Start]], beside: Standing
) -> dict[str, list[_Rough]]:
    """Fit every start in a few rough steps; returns per form the hypotheses, best first.

    The slopes by the numbers of the parent stay as they are without the effect. Where all numbers of the effect have
    been solved for beside those of the parent, that was the fit. A start that promises to leave far more than the
    best one leaves already, more than a fit makes up for, stays as it is.
    """
    before = sum(len(x.values) for x in parent.hypothesis.parts)
    first = min(starts, key=lambda x: x[1].square, default=None)
    judged = None if first is None else judge(problem, parent.hypothesis.plus(first[0], first[1].values))
    most = BUDGET.hopeless * (math.inf if judged is None else _with_steps(problem, judged))

    def rough(start: tuple[Form, Start]) -> _Rough | None:
        hypothesis = parent.hypothesis.plus(start[0], start[1].values)
        # what a fit of coarse readings leaves is told beyond their steps, which no promise does
        if start[1].square > most or (_is_solved(start[0]) and not _is_coarse(problem)):
            return _Rough(hypothesis, start[1].square)
        added = len(start[1].values)
        places = (k if k < before else k + added for k in range(beside.ridge.size))
        known = dict(zip(places, beside.slopes.T, strict=True))
        fitted = fit(problem, hypothesis, BUDGET.rough_evaluations, roughly=True, known=known)
        return None if fitted is None else _Rough(fitted.hypothesis, fitted.training_square)

    found: dict[str, list[_Rough]] = {}
    for (form, _), one in zip(starts, abreast(rough, starts), strict=True):
        if one is not None:
            found.setdefault(form.name, []).append(one)
    for several in found.values():
        several.sort(key=lambda x: x.square)
    return found


def most_promising_first(leaders: Sequence[Fitted]) -> list[Fitted]:
    """Return leading models with the one first that leaves least, unless it is far more flexible than the leader.

    Where another effect is missing, the criterion makes little of what is slow, and the one that it favours may lead
    nowhere; many numbers leave little, and a step on them takes long.
    """
    most = leaders[0].hypothesis.free_count + EVIDENCE.fewer_numbers if leaders else 0
    return sorted(leaders, key=lambda x: (x.hypothesis.free_count >= most, x.training_square))


def tried_on(found: Found, parent: Fitted, forms: Sequence[Form], others: Sequence[Fitted]) -> list[Fitted]:
    """Fit the most promising effects on top of a hypothesis; one per effect is returned, each in its best form.

    Those that are far behind the best, or behind others that were tried before, stay fitted roughly. So do flexible
    forms that would leave structure, and hardly less than a simple one does.
    """
    problem, noise_um = found.problem, found.noise_um
    most = BUDGET.fitted_later if parent.hypothesis.parts else BUDGET.fitted_first
    if only_one_sine(problem.observations):
        most = len(forms)
    rows = sum(int(x.training.sum()) for x in problem.observations)
    beside = standing(problem, parent)
    starts = _starts(problem, parent, forms, noise_um, beside)
    before = parent.hypothesis.free_count
    promised = [_Rough(x.hypothesis, _with_steps(problem, x)) for x in others]
    starts = [x for x in starts if not _is_behind(x[1].square, before + len(x[0].free), promised, BUDGET.hopeless)]
    rough = _roughly(problem, parent, starts, beside)
    fits = _Fits(found, others, rows, most)
    # simple ones first: many numbers are fitted only where they are worth it
    leaders = sorted((several[0] for several in rough.values()), key=lambda x: (_is_flexible(x), x.square))
    done: dict[int, tuple[Fitted | None, Fitted | None]] = {}
    for k, leader in enumerate(leaders):
        if fits.are_enough(leader):
            continue
        behind = fits.are_ahead(leader)
        fits.count(leader)
        if behind and leader.hypothesis.effects[-1] in fits.best:
            continue
        if not behind and k not in done:
            further = (n for n in range(k + 1, len(leaders)) if fits.want(leaders[n])) if fits.want(leader) else ()
            both = [k, *islice(further, 1)]
            found_here = abreast(lambda n: _fitted_plainly(problem, leaders[n].hypothesis, forms), both)
            done.update(zip(both, found_here, strict=True))
        fits.take((judge(problem, leader.hypothesis),) if behind else done[k])
    fits.take(_in_other_valleys(problem, fits, rough))
    return list(fits.best.values())


def _in_other_valleys(problem: FitProblem, fits: "_Fits", rough: Mapping[str, Sequence[_Rough]]) -> list[Fitted]:
    """Return the leaders from where they lay in other valleys of the misfit, where structure is left.

    A rough fit does not say which valley is the deepest.
    """
    leaders = sorted(fits.best.values(), key=lambda x: x.training_square)
    if not leaders or leaders[0].training_square <= fits.rows * (BUDGET.nearly_done * fits.found.noise_um) ** 2:
        return []
    most = BUDGET.behind * leaders[0].training_square
    others = [
        other.hypothesis
        for x in leaders[: BUDGET.beam]
        for other in rough.get(x.hypothesis.parts[-1].form.name, ())[1:]
        if x.training_square < most and other.square < most and _is_elsewhere(x.hypothesis, other.hypothesis)
    ]
    return [x for x in abreast(lambda x: fit(problem, x), others) if x is not None]


def _is_elsewhere(one: Hypothesis, other: Hypothesis) -> bool:
    """Return whether a number of the last effect differs by more than a fit from there on would make up for."""
    mine, theirs = one.parts[-1], other.parts[-1]
    numbers = zip(mine.form.free, mine.values, theirs.values, strict=True)
    return any(not x.solved and abs(a - b) > ELSEWHERE * max(abs(a), abs(b)) for x, a, b in numbers)


@dataclass(slots=True, eq=False)
class _Fits:
    """The best form of every effect that has been fitted in a step, at most so many effects, beside other hypotheses.

    Attributes:
        found: before the step.
        others: hypotheses that were fitted before.
        rows: that are fitted.
        most: effects.
        best: of every effect.
        forms_of: every effect, so many have been looked at, those of few and those of many numbers.
    """

    found: Found
    others: Sequence[Fitted]
    rows: int
    most: int
    best: dict[str, Fitted] = field(default_factory=dict)
    forms_of: dict[tuple[str, bool], int] = field(default_factory=dict)

    def count(self, leader: _Rough) -> None:
        """Count a form of the leader's effect."""
        kind = (leader.hypothesis.effects[-1], _is_flexible(leader))
        self.forms_of[kind] = self.forms_of.get(kind, 0) + 1

    def are_enough(self, leader: _Rough) -> bool:
        """Return whether no further form of the leader's effect is fitted."""
        kind = (leader.hypothesis.effects[-1], _is_flexible(leader))
        full = kind[0] not in self.best and len(self.best) == self.most
        return full or self.forms_of.get(kind, 0) == (BUDGET.flexible_forms if kind[1] else BUDGET.forms)

    def are_ahead(self, leader: _Rough) -> bool:
        """Return whether a leader is too far behind to be fitted to the end."""
        so_far = [*self.others, *self.best.values()]
        roughly = [_Rough(x.hypothesis, x.training_square) for x in so_far]
        if _is_behind(leader.square, leader.hypothesis.free_count, roughly, BUDGET.behind):
            return True
        return _is_flexible(leader) and not _is_worth_it(leader.square, self.found, so_far)

    def want(self, leader: _Rough) -> bool:
        """Return whether a leader of few numbers would be fitted to the end as things stand."""
        return leader.hypothesis.free_count <= FEW and not (self.are_enough(leader) or self.are_ahead(leader))

    def take(self, fitted: Sequence[Fitted | None]) -> None:
        """Keep of fitted forms of one effect those that cost less than the best one so far."""
        for x in fitted:
            if x is None:
                continue
            known = self.best.get(x.hypothesis.effects[-1])
            if known is None or _dearer(known, x, self.rows):
                self.best[x.hypothesis.effects[-1]] = x


def _fitted_plainly(
    problem: FitProblem, hypothesis: Hypothesis, forms: Sequence[Form]
) -> tuple[Fitted | None, Fitted | None]:
    """Fit a hypothesis, and then the plainer form of its last effect."""
    fitted = fit(problem, hypothesis)
    return fitted, None if fitted is None else in_a_plainer_form(problem, fitted, -1, forms)


def in_a_plainer_form(problem: FitProblem, fitted: Fitted, index: int, forms: Sequence[Form]) -> Fitted | None:
    """Fit the form that one effect's form refines, from where that one ended; None where it refines none.

    Rough fits of both say little of how near the plainer one comes.
    """
    parts = fitted.hypothesis.parts
    part = parts[index]
    plain = next((x for x in forms if x.name == part.form.refines), None)
    if plain is None:
        return None
    rest = fitted.hypothesis.minus(index % len(parts))
    return fit(problem, rest.plus(plain, part.values[: len(plain.free)]))


def _is_solved(form: Form) -> bool:
    return all(free.solved for free in form.free)


def _is_coarse(problem: FitProblem) -> bool:
    return any(x.half_step_um > 0.0 for x in problem.observations)


def _with_steps(problem: FitProblem, fitted: Fitted) -> float:
    """Return what a hypothesis leaves on the training rows as a scan would promise it, steps of the readings included.

    Steps are several times as large as what a good hypothesis leaves beyond them.
    """
    return problem.square_with_steps(fitted.residuals) if _is_coarse(problem) else fitted.training_square


def _is_behind(square: float, count: int, so_far: Sequence[_Rough], most: float) -> bool:
    """Return whether a promise is too far behind the best hypothesis so far for a fit to make up for it.

    One with as few numbers may still be preferred for them where it leaves little more; a far more flexible one that
    does not even promise less will not be.
    """
    best = min(so_far, key=lambda x: x.square, default=None)
    if best is None:
        return False
    flexible = count >= best.hypothesis.free_count + EVIDENCE.fewer_numbers
    return square > (min(BUDGET.flexible, most) if flexible else most) * best.square


def _is_flexible(leader: _Rough) -> bool:
    return len(leader.hypothesis.parts[-1].values) > EVIDENCE.fewer_numbers + 1


def _is_worth_it(square: float, found: Found, so_far: Sequence[Fitted]) -> bool:
    """Return whether a flexible form promises noise alone, or less than the form of a simple one may leave anyway."""
    best = min((x.training_square for x in so_far), default=math.inf)
    rows = sum(int(x.training.sum()) for x in found.problem.observations)
    if square <= rows * (BUDGET.nearly_done * found.noise_um) ** 2 or math.isinf(best):
        return True
    return best - square > EVIDENCE.inadequacy * (found.base.training_square - best)


def _dearer(known: Fitted, other: Fitted, rows: int) -> bool:
    """Return whether the first of two forms of one effect costs more than the second: misfit, and numbers to spend."""
    prices = [price(x.hypothesis.free_count, rows) for x in (known, other)]
    if math.isinf(prices[1]):
        return False
    # coarse readings may all lie within their steps
    squares = (max(x.training_square, 1e-300) for x in (known, other))
    return rows * math.log(next(squares) / next(squares)) + prices[0] - prices[1] > 0.0


def with_another_form(
    problem: FitProblem, fitted: Fitted, index: int, forms: Sequence[Form], noise_um: float
) -> Fitted | None:
    """Return the hypothesis with one effect in another form, None where none is better."""
    parts = fitted.hypothesis.parts
    rest, own = fitted.hypothesis.minus(index), parts[index].form
    others = [x for x in forms if x.effect == own.effect and x.name != own.name]
    scans = abreast(lambda x: scan_any(problem, rest, x, noise_um, keep=1), others)
    starts = [(form, start) for form, several in zip(others, scans, strict=True) for start in several]
    starts = sorted(starts, key=lambda x: x[1].square)[:FORMS_TRIED]

    def roughly(start: tuple[Form, Start]) -> Fitted | None:
        part = Part(start[0], start[1].values)
        placed = replace(fitted.hypothesis, parts=(*parts[:index], part, *parts[index + 1 :]))
        return fit(problem, placed, roughly=True)

    best: Fitted | None = None
    least = BETTER * fitted.training_square
    for rough in abreast(roughly, starts):
        if rough is None or rough.training_square > NEARLY * least:
            continue
        again = fit(problem, rough.hypothesis)
        if again is not None and again.training_square < least:
            best, least = again, again.training_square
    return best


def at_aliases(problem: FitProblem, fitted: Fitted) -> Fitted:
    """Return a hypothesis with the frequency of a ringing at the alias that leaves least.

    Rows on an even grid hardly distinguish a frequency from its aliases. Beside each of them the other effects have
    values of their own, which no scan that holds them finds; and what a wrong one leaves looks like noise from row to
    row, so that no noise floor tells. What swings for ever is the same at each of them: nothing could tell.
    """
    first = first_resonance(problem.base)
    even = all(are_even(x.time_s) for x in problem.observations)
    if first is None or not even:
        return fitted
    rates_Hz = {1.0 / float(np.median(np.diff(x.time_s))) for x in problem.observations}
    units_Hz = {("tip_mass", "frequency_ratio"): first[0], ("second_mode", "frequency_Hz"): 1.0}
    best = fitted
    for index, part in enumerate(fitted.hypothesis.parts):
        for k, free in enumerate(part.form.free):
            unit_Hz = units_Hz.get((part.form.effect, free.name))
            if unit_Hz is None:
                continue
            own_Hz = unit_Hz * part.values[k]
            others = {y for x in rates_Hz for y in aliases_Hz(own_Hz, x, unit_Hz * free.high)}
            within = sorted((x for x in others if x > unit_Hz * free.low), key=lambda x: abs(x - own_Hz))
            rest = fitted.hypothesis.minus(index)
            placed = [
                rest.plus(part.form, (*part.values[:k], other_Hz / unit_Hz, *part.values[k + 1 :]))
                for other_Hz in within[:ALIASES_TRIED]
            ]
            for rough in abreast(lambda x: fit(problem, x, 2 * BUDGET.rough_evaluations, roughly=True), placed):
                if rough is None or rough.training_square > NEARLY * best.training_square:
                    continue
                again = fit(problem, rough.hypothesis)
                if again is not None and again.training_square < BETTER * best.training_square:
                    best = again
    return best


def aliases_Hz(frequency_Hz: float, rate_Hz: float, highest_Hz: float) -> list[float]:
    """Return the other frequencies that look alike at so many rows a second."""
    lowest = frequency_Hz % rate_Hz
    turns = range(math.ceil(highest_Hz / rate_Hz) + 1)
    found = (sign * lowest + turn * rate_Hz for turn in turns for sign in (1.0, -1.0))
    return sorted(x for x in found if 0.0 < x <= highest_Hz and not math.isclose(x, frequency_Hz))


def rings_away(problem: FitProblem, hypothesis: Hypothesis) -> list[Hypothesis]:
    """Return a hypothesis with its delay, or the model's own, by whole periods of the first mode shorter or longer."""
    first, given = first_resonance(problem.base), first_mode(problem.base).get(tip_mass.ID)
    if first is None or given is None:
        return []
    period_s = given / (first[0] * first_mode(hypothesis.model(problem.base))[tip_mass.ID])
    values, found = hypothesis.values(), []
    for k, free in enumerate(hypothesis.free):
        if free.name not in DELAY_NAMES:
            continue
        for rings in RINGS:
            delay_s = values[k] + rings * period_s
            if free.low < delay_s < free.high:
                found.append(hypothesis.with_values((*values[:k], delay_s, *values[k + 1 :])))
    return found


def at_other_rings(problem: FitProblem, fitted: Fitted) -> Fitted:
    """Return a hypothesis with the model's own delay, where it is free, at the ring that leaves least."""
    own = fitted.hypothesis.own
    if own is None or OWN_DELAY not in [x.name for x in own.form.free]:
        return fitted
    others = abreast(lambda x: fit(problem, x), rings_away(problem, fitted.hypothesis))
    return min((fitted, *(x for x in others if x is not None)), key=lambda x: x.training_square)
