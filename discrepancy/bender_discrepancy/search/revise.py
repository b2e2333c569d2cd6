"""Early choices looked at again beside a later effect: other values, other forms of the same effects.

An effect that is sought alone takes what it can of the others: its values may sit in a side valley, and the form that
was best alone may not be the best one beside them. What a wrong form leaves is slow, as a rule, and makes readings look
dependent on each other that are not: the evidence for the later effect would be lost in it.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from bender_compiled.abreast import abreast
from bender_discrepancy.effects.form import Form
from bender_discrepancy.fitting.criterion import STARTS_OF_A_FORM, cost, held_gain, yardstick
from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.hypothesis import Part
from bender_discrepancy.fitting.output_error import Fitted, fit
from bender_discrepancy.fitting.scans.chosen import scan_any
from bender_discrepancy.search.budget import BUDGET
from bender_discrepancy.search.certain import certain
from bender_discrepancy.search.evidence import EVIDENCE, Evidence, is_finished, is_plainer, simplest_as_good
from bender_discrepancy.search.state import Found, Ranked, rms_um
from bender_discrepancy.search.step import at_aliases, in_a_plainer_form, with_another_form
from bender_discrepancy.search.verdict import would_stand


def looked_back(problem: FitProblem, fitted: Fitted, forms: Sequence[Form], noise_um: float) -> Fitted:
    """Return a hypothesis with the values and the forms of its effects looked at again, the early ones first.

    The last one has been tried in every form, but beside values that the others had without it: another one counts
    where no further effect is sought in what it leaves.

    Args:
        problem: the records.
        fitted: of two effects or more.
        forms: that are tried.
        noise_um: noise floor; forms are left as they are where noise alone is left.
    """
    found = _with_other_values(problem, fitted, noise_um)
    found = at_aliases(problem, found)
    last, little_um = len(found.hypothesis.parts) - 1, math.sqrt(1.0 + EVIDENCE.least_rest) * noise_um
    for index in range(last + 1):
        if rms_um(found, problem, held=False) < BUDGET.nearly_done * noise_um:
            break
        other = with_another_form(problem, found, index, forms, noise_um)
        if other is None or (index == last and rms_um(other, problem) >= little_um):
            continue
        found = other
    return found


def _with_other_values(problem: FitProblem, fitted: Fitted, noise_um: float) -> Fitted:
    """Search again for the values of each effect while the others stand: an early choice may sit in a side valley."""

    def again(index: int) -> list[Fitted]:
        rest, form = fitted.hypothesis.minus(index), fitted.hypothesis.parts[index].form
        starts = scan_any(problem, rest, form, noise_um, keep=1)
        return [x for x in (fit(problem, rest.plus(form, y.values)) for y in starts) if x is not None]

    found = abreast(again, range(len(fitted.hypothesis.parts)))
    better = (x for several in found for x in several if x.training_square < 0.999 * fitted.training_square)
    return next(better, fitted)


def in_simple_forms(
    problem: FitProblem, fitted: Fitted, forms: Sequence[Form], noise_um: float, most_square: float
) -> list[Fitted]:
    """Return a hypothesis with one of its effects in another form of few numbers, each that leaves no more than asked.

    Alone, a flexible form takes what it can of the effects that are missing beside it, and so does one of few numbers
    that happens to be nearer to all of them together. Beside the right effect another simple form may be the right one;
    one that the form at hand contains was never excluded.
    """
    parts = fitted.hypothesis.parts

    def placed(other: tuple[int, Form]) -> list[Fitted]:
        index, form = other
        rest = fitted.hypothesis.minus(index)
        starts = (Part(form, x.values) for x in scan_any(problem, rest, form, noise_um, keep=1))
        hypotheses = (replace(rest, parts=(*parts[:index], x, *parts[index + 1 :])) for x in starts)
        return [x for x in (fit(problem, y) for y in hypotheses) if x is not None and x.training_square <= most_square]

    others = [
        (index, form)
        for index, part in enumerate(parts)
        for form in forms
        if form.effect == part.form.effect
        and form.name != part.form.name
        and len(form.free) <= EVIDENCE.fewer_numbers + 1
        and not part.form.contains(form, problem.base)
    ]
    return [x for several in abreast(placed, others) for x in several]


def in_their_best_forms(found: Found, forms: Sequence[Form], by: Evidence = EVIDENCE) -> Found:
    """Return what was found with its effects in the forms that leave least, where they are named and structure is left.

    While a further effect is sought, a simple form may leave what a flexible one would take up: that may be the next
    effect. In the end it is only what the simple form misses of its own. Names do not change: the rows of choices alone
    must show the other form, and beside it every effect has to stand.
    """
    if not would_stand(found, by) or is_finished(found.best, found, by):
        return found
    for index in range(len(found.best.hypothesis.parts)):
        other = with_another_form(found.problem, found.best, index, forms, found.noise_um)
        if other is None or not other.hypothesis.keeps_shown_of(found.best.hypothesis):
            continue
        if simplest_as_good([other, found.best], found.base, nothing_left=True) is not other:
            continue
        weighed_by = yardstick(found.problem, other, STARTS_OF_A_FORM * len(forms), by.confidence)
        gained = cost(found.best, weighed_by) - cost(other, weighed_by)
        if min(gained, held_gain(found.best, other, weighed_by)) <= weighed_by.threshold:
            continue
        sure = certain(replace(found, best=other, steps=(*found.steps[:-1], other)), by, forms)
        if set(sure.best.hypothesis.effects) == set(other.hypothesis.effects) and would_stand(sure, by):
            found = sure
    return found


def with_plainer_forms(found: Found, forms: Sequence[Form]) -> Found:
    """Return what was found with its effects in plainer forms among what it was chosen from.

    Only where another effect has fewer numbers and comes as near: whether the further numbers decide shows against
    these.
    """
    best = set(found.best.hypothesis.effects)
    others = (x.fitted for x in found.last_ranking if set(x.fitted.hypothesis.effects) != best)
    if not any(is_plainer(x, found.best, found.base) for x in others):
        return found
    plainer = [x for k in range(len(found.best.hypothesis.parts)) for x in _plainer_and_plainer(found, k, forms)]
    before = cost(found.steps[-2], found.yardstick)
    ranked = [Ranked(x, cost(x, found.yardstick) - before) for x in plainer]
    return replace(found, last_ranking=tuple(sorted((*found.last_ranking, *ranked), key=lambda x: x.difference)))


def _plainer_and_plainer(found: Found, index: int, forms: Sequence[Form]) -> list[Fitted]:
    """Return the best hypothesis with one of its effects in the form that its own refines, and so on."""
    plainer: list[Fitted] = []
    fitted = in_a_plainer_form(found.problem, found.best, index, forms)
    while fitted is not None:
        plainer.append(fitted)
        fitted = in_a_plainer_form(found.problem, fitted, -1, forms)
    return plainer
