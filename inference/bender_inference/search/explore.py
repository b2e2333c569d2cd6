"""What moves propose, fitted: forms are scanned, the most promising fitted roughly, the leaders of these to the end."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bender_compiled.parallel_map import parallel_map
from bender_effects.form import Form
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import Fitted, fit, judge
from bender_inference.fitting.scans.chosen import scan_any
from bender_inference.fitting.standing import Standing, standing
from bender_inference.fitting.starts import Start as Promise
from bender_inference.records.observations import only_one_sine
from bender_inference.search.archive import Archive
from bender_inference.search.budget import BUDGET
from bender_inference.search.moves import Catalogue, Move, Scan, Start, add

ELSEWHERE = 0.05
"""Of a number: a valley of the misfit is wider, as a rule."""


@dataclass(frozen=True, slots=True, eq=False)
class Rough:
    """A hypothesis after a rough fit and the sum of squares on the training rows that it promises."""

    hypothesis: Hypothesis
    square: float

    @property
    def is_flexible(self) -> bool:
        """Whether its last effect has many numbers."""
        return len(self.hypothesis.parts[-1].values) > BUDGET.few_numbers


def explore(
    archive: Archive,
    catalogue: Catalogue,
    parents: Sequence[Fitted],
    moves: Sequence[Move],
    goes_on: Callable[[], bool] = lambda: True,
) -> list[Fitted]:
    """Return the fits of what the moves propose on some fitted hypotheses, all kept in the archive.

    Args:
        archive: keeps the fits.
        catalogue: what may be chosen from.
        parents: the hypotheses.
        moves: what proposes.
        goes_on: is asked before every scan of forms.
    """
    proposed = [x for parent in parents for move in moves for x in move(archive, catalogue, parent)]
    starts = [x.hypothesis for x in proposed if isinstance(x, Start)]
    found = _from_starts(archive, starts, parents)
    for x in proposed:
        if isinstance(x, Scan) and goes_on():
            found += _from_scan(archive, x, [*parents, *found])
    return found


def explore_beside_each(
    archive: Archive, catalogue: Catalogue, parents: Sequence[Fitted], least: float
) -> list[Fitted]:
    """Return fits of the best of what one quickly scanned effect more promises on any of many hypotheses.

    Two effects that hide each other take little off alone: neither leads, and only what the pair leaves shows it.

    Args:
        archive: keeps the fits.
        catalogue: what may be chosen from.
        parents: the hypotheses.
        least: sum of squares on the training rows below which a promise is worth a fit.
    """
    promised: dict[frozenset[str], tuple[float, Hypothesis]] = {}
    for parent in (x for x in parents if x.training_square <= BUDGET.far * least):
        for scan in add(archive, catalogue, parent):
            if isinstance(scan, Scan):
                _promise_quickly(archive, scan, promised)
    best = sorted((x for x in promised.values() if x[0] < least), key=lambda x: x[0])[: BUDGET.fitted_later]
    return archive.add(parallel_map(lambda x: fit(archive.problem, x[1]), best))


def _promise_quickly(archive: Archive, scan: Scan, promised: dict[frozenset[str], tuple[float, Hypothesis]]) -> None:
    """Keep the best promise of every set of effects, of forms of one number or of few that are solved for."""
    try:
        beside = standing(archive.problem, scan.parent)
    except np.linalg.LinAlgError:
        return
    forms = [x for x in scan.forms if len(x.free) == 1 or (_is_solved(x) and len(x.free) <= BUDGET.few_numbers)]
    for form, starts in zip(forms, _scans(archive, scan.parent, forms, beside, 1), strict=True):
        for start in starts:
            hypothesis = scan.parent.hypothesis.plus(form, start.values)
            effects = frozenset(hypothesis.effects)
            if effects not in promised or start.square < promised[effects][0]:
                promised[effects] = start.square, hypothesis


def _from_starts(archive: Archive, starts: Sequence[Hypothesis], parents: Sequence[Fitted]) -> list[Fitted]:
    """Fit starts in a few steps, and to the end where they may come near the best of what is known."""
    if not starts:
        return []
    few = parallel_map(lambda x: fit(archive.problem, x, BUDGET.first_evaluations, roughly=True), starts)
    alive = [x for x in few if x is not None]
    least = min((x.training_square for x in (*alive, *parents)), default=math.inf)
    near = [x for x in alive if x.training_square <= BUDGET.behind * least]
    far = [x for x in alive if x.training_square > BUDGET.behind * least]
    ended = parallel_map(lambda x: fit(archive.problem, x.hypothesis), near)
    return archive.add([*ended, *parallel_map(lambda x: judge(archive.problem, x.hypothesis), far)])


def _from_scan(archive: Archive, scan: Scan, known: Sequence[Fitted]) -> list[Fitted]:
    """Scan forms on a hypothesis, fit those roughly that promise most, and the leaders to the end."""
    problem, parent = archive.problem, scan.parent
    forms = archive.not_scanned(parent, scan.forms)
    if not forms:
        return []
    try:
        beside = standing(problem, parent)
    except np.linalg.LinAlgError:
        return []
    promises = _promises(archive, parent, forms, beside)
    before = min((_with_steps(problem, x) for x in known), default=math.inf)
    rough = _roughly(problem, parent, promises, beside, before)
    least = min((x.square for x in rough), default=math.inf)
    simple = [x for x in _leaders(rough, parent) if not x.is_flexible]
    simple = [x for x in simple if x.square <= BUDGET.behind * min(least, before)]
    found = archive.add(parallel_map(lambda x: fit(problem, x.hypothesis), simple))
    best = min((x.training_square for x in found), default=math.inf)
    best = min(best, before)
    flexible = [x for x in _leaders(rough, parent) if x.is_flexible and _is_worth_it(archive, x, best)]
    found += archive.add(parallel_map(lambda x: fit(problem, x.hypothesis), flexible))
    found += archive.add(parallel_map(lambda x: fit(problem, x), _elsewhere(archive, found, rough)))
    # what stays behind is kept as it is: it is a rival all the same
    fitted = {x.hypothesis.parts[-1].form.name for x in found}
    others = [x.hypothesis for x in _leaders(rough, parent) if x.hypothesis.parts[-1].form.name not in fitted]
    return found + archive.add(parallel_map(lambda x: judge(problem, x), others))


def _promises(archive: Archive, parent: Fitted, forms: Sequence[Form], beside: Standing) -> list[tuple[Form, Promise]]:
    """Return the best starts of the effects that promise most; a refined form sets out where its plain one promises."""
    problem = archive.problem
    rows = sum(int(x.training.sum()) for x in problem.observations)
    scanned = [x for x in forms if BUDGET.readings_per_number * len(x.free) <= rows]
    names = {x.name for x in scanned}
    first = [x for x in scanned if x.refines not in names]
    promising = dict(zip([x.name for x in first], _scans(archive, parent, first, beside), strict=True))
    while later := [x for x in scanned if x.name not in promising and x.refines in promising]:
        near = [(x, x.setting_out_from([start.values])) for x in later for start in promising[x.refines]]
        promising |= {x.name: [] for x in later}
        for (form, _), best in zip(near, _scans(archive, parent, [x for _, x in near], beside, 1), strict=True):
            promising[form.name] += best
    found = [(form, start) for form in scanned for start in promising[form.name]]
    most = BUDGET.rough_later if parent.hypothesis.parts else BUDGET.rough_first
    if only_one_sine(problem.observations):
        most = len(forms)
    return _first_effects(sorted(found, key=lambda x: x[1].square), most)


def _scans(
    archive: Archive, parent: Fitted, forms: Sequence[Form], beside: Standing, keep: int = BUDGET.valleys
) -> list[list[Promise]]:
    def one(form: Form) -> list[Promise]:
        try:
            found = scan_any(archive.problem, parent.hypothesis, form, archive.noise_um, keep, beside)
        except (np.linalg.LinAlgError, FloatingPointError, OverflowError):
            return []
        return [x for x in found if math.isfinite(x.square)]

    return parallel_map(one, forms)


def _first_effects(starts: list[tuple[Form, Promise]], most: int) -> list[tuple[Form, Promise]]:
    """Return the best starts of the effects that promise most, some of each kind.

    A start that was solved for in all its numbers promises what a fit will find, another one less; one of a form that
    refines another promises more than its plainer one in the same valley.
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


def _roughly(
    problem: FitProblem,
    parent: Fitted,
    promises: Sequence[tuple[Form, Promise]],
    beside: Standing,
    known: float,
) -> list[Rough]:
    """Return the hypotheses after a few rough steps from every start, best first.

    The slopes by the numbers of the parent stay as they are without the effect. Where all numbers of the effect have
    been solved for beside those of the parent, that was the fit; what promises to leave far more than the best start
    leaves already stays as it is.
    """
    before = sum(len(x.values) for x in parent.hypothesis.parts)
    first = min(promises, key=lambda x: x[1].square, default=None)
    judged = None if first is None else judge(problem, parent.hypothesis.plus(first[0], first[1].values))
    most = BUDGET.hopeless * min(known, math.inf if judged is None else _with_steps(problem, judged))

    def rough(promise: tuple[Form, Promise]) -> Rough | None:
        form, start = promise
        hypothesis = parent.hypothesis.plus(form, start.values)
        if start.square > most or (_is_solved(form) and not _is_coarse(problem)):
            return Rough(hypothesis, start.square)
        places = (k if k < before else k + len(start.values) for k in range(beside.ridge.size))
        known = dict(zip(places, beside.slopes.T, strict=True))
        fitted = fit(problem, hypothesis, BUDGET.rough_evaluations, roughly=True, known=known)
        return None if fitted is None else Rough(fitted.hypothesis, fitted.training_square)

    found = [x for x in parallel_map(rough, promises) if x is not None]
    return sorted(found, key=lambda x: x.square)


def _leaders(rough: Sequence[Rough], parent: Fitted) -> list[Rough]:
    """Return the best rough fits of the leading effects: some forms of few numbers, and one of many."""
    most = BUDGET.fitted_later if parent.hypothesis.parts else BUDGET.fitted_first
    forms: dict[str, list[Rough]] = {}
    for x in rough:
        own = forms.setdefault(x.hypothesis.effects[-1], [])
        alike = [y for y in own if y.is_flexible == x.is_flexible]
        names = {y.hypothesis.parts[-1].form.name for y in alike}
        allowed = 1 if x.is_flexible else BUDGET.forms
        if len(alike) < allowed and x.hypothesis.parts[-1].form.name not in names:
            own.append(x)
    return [x for own in list(forms.values())[:most] for x in own]


def _is_worth_it(archive: Archive, rough: Rough, simple_square: float) -> bool:
    """Return whether a flexible form promises noise alone, or clearly less than the simple ones leave above it.

    What is left is held against what would take it up next: another effect, which takes as little for itself.
    """
    rows = sum(int(x.training.sum()) for x in archive.problem.observations)
    nearly_noise = rows * (BUDGET.nearly_done * archive.noise_um) ** 2
    if rough.square <= nearly_noise or math.isinf(simple_square):
        return True
    return simple_square > nearly_noise and rough.square < (1.0 - BUDGET.flexible) * simple_square


def _elsewhere(archive: Archive, found: Sequence[Fitted], rough: Sequence[Rough]) -> list[Hypothesis]:
    """Return the leaders from where they lay in other valleys of the misfit, where structure is left.

    A rough fit does not say which valley is the deepest.
    """
    leaders = sorted(found, key=lambda x: x.training_square)
    rows = sum(int(x.training.sum()) for x in archive.problem.observations)
    if not leaders or leaders[0].training_square <= rows * (BUDGET.nearly_done * archive.noise_um) ** 2:
        return []
    most = BUDGET.behind * leaders[0].training_square
    own = [x.hypothesis.parts[-1] for x in leaders[: BUDGET.beam]]
    others = []
    for x in rough:
        last = x.hypothesis.parts[-1]
        same = [y for y in own if y.form.name == last.form.name]
        if x.square < most and same and all(_apart(y.values, last.values) for y in same):
            others.append(x.hypothesis)
    return others[: BUDGET.beam]


def _apart(one: Sequence[float], other: Sequence[float]) -> bool:
    return any(abs(a - b) > ELSEWHERE * max(abs(a), abs(b)) for a, b in zip(one, other, strict=True))


def _is_solved(form: Form) -> bool:
    return all(free.solved for free in form.free)


def _is_coarse(problem: FitProblem) -> bool:
    return any(x.half_step_um > 0.0 for x in problem.observations)


def _with_steps(problem: FitProblem, fitted: Fitted) -> float:
    """Return what a hypothesis leaves on the training rows as a scan would promise it, steps of the readings included.

    Steps are several times as large as what a good hypothesis leaves beyond them.
    """
    return problem.square_with_steps(fitted.residuals) if _is_coarse(problem) else fitted.training_square
