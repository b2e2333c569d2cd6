"""One step of the search: every effect is tried on top of a hypothesis, roughly first, the leaders to the end."""

import math
from collections.abc import Sequence

from bender_compiled.abreast import abreast
from bender_discrepancy.effects.form import Form
from bender_discrepancy.fitting.criterion import price
from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.output_error import Fitted, fit
from bender_discrepancy.fitting.special_starts import scan_any
from bender_discrepancy.fitting.starts import Start
from bender_discrepancy.records.observations import only_one_sine
from bender_discrepancy.search.budget import BUDGET


def _starts(problem: FitProblem, parent: Fitted, forms: Sequence[Form], noise_um: float) -> list[tuple[Form, Start]]:
    found: list[tuple[Form, Start]] = []
    taken = set(parent.hypothesis.effects)
    rows = sum(int(x.training.sum()) for x in problem.observations)
    keep = 1 if parent.hypothesis.parts else 2
    scanned = [x for x in forms if x.effect not in taken and BUDGET.readings_per_number * len(x.free) <= rows]
    scans = abreast(lambda form: scan_any(problem, parent.hypothesis, form, noise_um, keep), scanned)
    for form, starts in zip(scanned, scans, strict=True):
        found += [(form, start) for start in starts]
    most = BUDGET.rough_later if parent.hypothesis.parts else BUDGET.rough_first
    if only_one_sine(problem.observations):
        most = len(forms)
    return _leading(sorted(found, key=lambda x: x[1].square), most)


def _leading(starts: list[tuple[Form, Start]], most: int) -> list[tuple[Form, Start]]:
    """Return the best starts of the effects that promise most.

    A start that was solved for in all its numbers promises what a fit will find, another one less: each kind counts
    apart.
    """
    kept: dict[str, list[bool]] = {}
    found = []
    for form, start in starts:
        if form.effect not in kept and len(kept) == most:
            continue
        kinds = kept.setdefault(form.effect, [])
        kinds.append(_is_solved(form))
        if kinds.count(kinds[-1]) <= BUDGET.starts:
            found.append((form, start))
    return found


def _roughly(problem: FitProblem, parent: Fitted, starts: list[tuple[Form, Start]]) -> dict[str, list[Fitted]]:
    """Fit every start in a few rough steps; returns per form the fits, best first."""

    def rough(start: tuple[Form, Start]) -> Fitted | None:
        hypothesis = parent.hypothesis.plus(start[0], start[1].values)
        return fit(problem, hypothesis, BUDGET.rough_evaluations, roughly=True)

    found: dict[str, list[Fitted]] = {}
    for (form, _), fitted in zip(starts, abreast(rough, starts), strict=True):
        if fitted is not None:
            found.setdefault(form.name, []).append(fitted)
    for fits in found.values():
        fits.sort(key=lambda x: x.training_square)
    return found


def tried_on(
    problem: FitProblem, parent: Fitted, forms: Sequence[Form], noise_um: float, others: Sequence[Fitted]
) -> list[Fitted]:
    """Fit the most promising effects on top of a hypothesis; one per effect is returned, each in its best form.

    Where one of them, or of others that were tried before, leaves noise alone, those that leave far more stay fitted
    roughly.
    """
    most = BUDGET.fitted_later if parent.hypothesis.parts else BUDGET.fitted_first
    if only_one_sine(problem.observations):
        most = len(forms)
    rows = sum(int(x.training.sum()) for x in problem.observations)
    noise = rows * (BUDGET.nearly_done * noise_um) ** 2
    starts = _starts(problem, parent, forms, noise_um)
    starts = [x for x in starts if not (_is_solved(x[0]) and _is_hopeless(x[1].square, others, noise))]
    rough = _roughly(problem, parent, starts)
    leaders = sorted((fits[0] for fits in rough.values()), key=lambda x: x.training_square)
    best: dict[str, Fitted] = {}
    forms_of: dict[str, int] = {}
    for leader in leaders:
        effect = leader.hypothesis.effects[-1]
        if (effect not in best and len(best) == most) or forms_of.get(effect, 0) == BUDGET.forms:
            continue
        forms_of[effect] = forms_of.get(effect, 0) + 1
        if _is_hopeless(leader.training_square, [*others, *best.values()], noise):
            best.setdefault(effect, leader)
            continue
        fitted = fit(problem, leader.hypothesis)
        if fitted is None:
            continue
        known = best.get(effect)
        if known is None or _dearer(known, fitted, rows):
            best[effect] = fitted
    return list(best.values())


def _is_solved(form: Form) -> bool:
    return all(free.solved for free in form.free)


def _is_hopeless(square: float, fitted: Sequence[Fitted], noise: float) -> bool:
    least = min((x.training_square for x in fitted), default=math.inf)
    return least <= noise and square > BUDGET.hopeless * least


def _dearer(known: Fitted, other: Fitted, rows: int) -> bool:
    """Return whether the first of two forms of one effect costs more than the second: misfit, and numbers to spend."""
    prices = [price(x.hypothesis.free_count, rows) for x in (known, other)]
    if math.isinf(prices[1]):
        return False
    return rows * math.log(known.training_square / other.training_square) + prices[0] - prices[1] > 0.0
