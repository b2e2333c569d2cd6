"""What was found in excerpts, held against readings from all over the long records that they were taken from.

What is slow beside an excerpt (drift, ageing) is fitted anew on readings spread over the whole; what then leaves
structure there is not named.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bender_effects.form import Form
from bender_inference.fitting.fit_problem import COARSER, FitProblem, problem_of
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import Fitted, fit, judge
from bender_inference.fitting.starts import scan
from bender_inference.records.excerpt import Excerpt
from bender_inference.records.observations import Array, Observations, Part
from bender_inference.records.roles import folds_of, held_out_and_reported
from bender_inference.search.budget import BUDGET
from bender_inference.search.judgement.grades import Grades, contradicted
from bender_inference.search.judgement.rules import Rules
from bender_inference.search.judgement.verdict import PARTLY, Verdict
from bender_inference.search.noise import floor_square_um2, square_on
from bender_inference.search.search import Searched
from bender_loop.records.outliers import EXCEPTIONS, deviation
from bender_loop.records.telling_rows import Rows
from bender_plant.parameter import ModelError
from bender_plant.plant import sub_step_bounds_s

# readings of one record that are looked at
MOST_READINGS = 6_000
# of one simulation; memory grows with them
MOST_SUBSTEPS = 5e6
# times its deviation: a reading further off is set aside
FAR = 6.0
# a fit to the whole may cost this much of the square in the excerpt
AS_GOOD = 1.05
# part of the residual: an effect that would leave more is no lead
TELLING = 0.9
# verdicts that say that nothing is left
TAKEN_BACK = ("named", "recalibrated", "no_gap")


@dataclass(frozen=True, slots=True, eq=False)
class FullRecordCheck:
    """What was found, with numbers that hold for the whole, and what it leaves there.

    Attributes:
        found: by the search, refitted where that was needed.
        gap_um: rms of what the model as given leaves, recalibrated.
        left_um: rms of the residual in the end.
        lead: a slow effect that would leave less on the whole, and the rms that it would leave in um.
        rows: of every record, those from all over it that numbers and verdict were fitted to; none where they were not.
    """

    found: Searched
    gap_um: float
    left_um: float
    lead: tuple[str, float] | None = None
    rows: tuple[Rows, ...] = ()


def check_on_full_record(parts: Sequence[Excerpt], found: Searched, slow: Sequence[Form]) -> FullRecordCheck | None:
    """Return what was found in excerpts, held against the whole records; None where that takes too long.

    Where structure is left, the numbers are fitted anew on the whole, and kept if they fit the excerpts as well.

    Args:
        parts: the excerpts.
        found: what the search found in them.
        slow: forms of effects that may be slow beside an excerpt, sized to the whole.
    """
    problem, noise_um = found.archive.problem, found.archive.noise_um
    if not _is_affordable(problem, parts, found.best):
        return None
    whole = problem_of(problem.base, tuple(_spread(x, y) for x, y in zip(parts, problem.observations, strict=True)))
    base, given = judge(whole, found.base.hypothesis), judge(whole, found.best.hypothesis)
    if base is None or given is None:
        return None
    rows = zip(whole.observations, given.residuals, strict=True)
    whole = whole.observing([_without_strays(x, r) for x, r in rows])
    gap, left = _left_um(whole, base), _left_um(whole, given)
    little = BUDGET.nearly_done * math.sqrt(floor_square_um2(whole, noise_um))
    if left <= little:
        return FullRecordCheck(found, gap, left)
    sized = _sized(found.best.hypothesis, slow)
    refitted = fit(whole, sized, closely=True) if sized.all_parts else None
    again = None if refitted is None else judge(problem, refitted.hypothesis)
    if refitted is not None and again is not None and again.training_square <= AS_GOOD * found.best.training_square:
        better = replace(again, covariance=refitted.covariance)
        found.archive.add([better])
        found, left = replace(found, best=better), _left_um(whole, refitted)
    lead = None if left <= little else _lead(whole, found.best.hypothesis, slow)
    return FullRecordCheck(found, gap, left, lead, tuple(_rows(x) for x in whole.observations))


def _rows(x: Observations) -> Rows:
    """Return the rows of a whole record that some readings from all over it are."""
    assert x.part is not None
    return x.part.rows


def _sized(hypothesis: Hypothesis, slow: Sequence[Form]) -> Hypothesis:
    """Return the hypothesis with the bounds of slow effects sized to the whole."""
    forms = {x.name: x for x in slow}
    parts = tuple(replace(x, form=forms.get(x.form.name, x.form)) for x in hypothesis.parts)
    return replace(hypothesis, parts=parts)


def _lead(whole: FitProblem, hypothesis: Hypothesis, slow: Sequence[Form]) -> tuple[str, float] | None:
    """Return the slow effect that leaves least beside a hypothesis, and the rms that it leaves."""
    found: list[tuple[str, float]] = []
    for form in slow:
        if form.effect not in hypothesis.effects:
            fits = [fit(whole, hypothesis.plus(form, x.values)) for x in scan(whole, hypothesis, form, keep=1)]
            found += [(form.effect, _left_um(whole, x)) for x in fits if x is not None]
    return min(found, key=lambda x: x[1], default=None)


def judged_on_full_record(
    grades: Grades, verdict: Verdict, held: FullRecordCheck, rules: Rules
) -> tuple[Grades, Verdict]:
    """Return what is said of excerpts, taken back where structure is left on the whole that they do not show."""
    archive = held.found.archive
    floor = floor_square_um2(archive.problem, archive.noise_um)
    left, gap = (max(x**2 - floor, 0.0) for x in (held.left_um, held.gap_um))
    if verdict.word not in TAKEN_BACK or left <= rules.at_noise * floor:
        return grades, verdict
    if grades.effects and left <= (1.0 - rules.closes) * gap:
        return grades, Verdict(verdict.word, PARTLY, complete=False)
    reason = "over the whole records the residual has structure that does not show in the rows that were searched"
    if held.lead and held.lead[1] < TELLING * held.left_um:
        part = 1.0 - held.lead[1] / held.left_um
        reason += f"; {held.lead[0]} over the whole record would remove {100.0 * part:.0f} % off it"
    closed = 1.0 - left / gap if gap > 0.0 else 0.0
    lowered = replace(grades, effects=tuple(contradicted(x, closed) for x in grades.effects))
    return lowered, Verdict("likely" if grades.effects else "unexplained", reason, complete=False)


def _is_affordable(problem: FitProblem, parts: Sequence[Excerpt], fitted: Fitted) -> bool:
    try:
        longest_s = sub_step_bounds_s(fitted.hypothesis.model(problem.base))[1]
    except ModelError:
        return False
    substeps = sum(x.whole.time_s.size + float(np.ptp(x.whole.time_s)) / (COARSER * longest_s) for x in parts)
    return substeps <= MOST_SUBSTEPS


def _spread(excerpt: Excerpt, seen: Observations) -> Observations:
    """Return readings from all over a record, under every command of it."""
    x = excerpt.judged(seen)
    rows = np.flatnonzero(x.usable)
    # the others are left to be reported on
    rows = rows[np.linspace(0, rows.size - 1, min(rows.size // 2, MOST_READINGS)).astype(int)]
    drive = replace(x.drive, row_time_s=x.time_s[rows])
    usable = np.ones(rows.size, dtype=np.bool_)
    roles = held_out_and_reported(usable, x.command_V[rows])
    return replace(
        seen,
        drive=drive,
        measured_um=x.measured_um[rows],
        usable=usable,
        held_out=roles[0],
        reported=roles[1],
        lacking_um=None if x.lacking_um is None else x.lacking_um[rows],
        part=Part(rows, rows - x.usable.size, x.command_V[rows[0] : rows[-1] + 1]),
        first_folds=folds_of(usable),
    )


def _without_strays(x: Observations, residual: Array) -> Observations:
    """Return the observations without readings that are far off: where they are no exception, they are no strays."""
    stray = np.abs(residual - np.median(residual)) > FAR * deviation(residual)
    return x.without(stray) if np.count_nonzero(stray) <= EXCEPTIONS * stray.size else x


def _left_um(problem: FitProblem, fitted: Fitted) -> float:
    return math.sqrt(square_on(problem, fitted, [x.usable for x in problem.observations]))
