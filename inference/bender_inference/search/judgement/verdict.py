"""The contract's word for what a search found, and why, in one sentence."""

import math
from dataclasses import dataclass
from typing import Literal

from bender_inference.fitting.output_error import Fitted
from bender_inference.search.archive import Archive
from bender_inference.search.judgement.grades import Doubt, Graded, Grades, is_complete
from bender_inference.search.judgement.rules import Rules
from bender_inference.search.noise import extremes_at_floor, floor_square_um2, residual_square_um2
from bender_inference.search.search import Searched
from bender_report.wording import listed

Word = Literal["named", "likely", "ambiguous", "unexplained", "recalibrated", "no_gap"]

PARTLY = "every effect passed its tests; a part of the residual above the noise stays unexplained"
DOUBTS: dict[Doubt, str] = {
    "size": "the 95 % interval of the size of {} includes zero effect",
    "share": "{} closes next to nothing of the gap in the mean over all orders of adding",
}


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict and why.

    Attributes:
        word: the contract's.
        reason: in one sentence, without the size of the residual: that is measured later, on rows that no choice sees.
        complete: whether nothing is left above the noise floor.
    """

    word: Word
    reason: str
    complete: bool = True


def decide(searched: Searched, grades: Grades, rules: Rules) -> Verdict:
    """Return the verdict on what a search found."""
    if not grades.effects:
        return _without_effects(searched, rules)
    complete = grades.complete
    if grades.one_sine:
        return Verdict(
            "ambiguous", "a record of one frequency at one amplitude cannot distinguish effects with memory", complete
        )
    if grades.commuting:
        reason = (
            "the two lags fit as well with their time constants exchanged; a signal measured between them would decide"
        )
        return Verdict("ambiguous", reason, complete)
    if all(x.grade == "certain" for x in grades.effects):
        if complete:
            return Verdict("named", "every effect passed its tests, and the residual is at the noise floor")
        return Verdict("named", PARTLY, complete=False)
    rivals = list(dict.fromkeys(y.id for x in grades.effects for y in x.near_rivals))
    leading = max(grades.effects, key=lambda x: x.probability)
    if complete and rivals:
        return Verdict("ambiguous", f"the records do not contain enough evidence to exclude {listed(rivals, 'or')}")
    if rivals and (leading.grade == "possible" or _is_within_reach(leading, rules)):
        reason = f"{listed(rivals, 'or')} would predict unseen readings nearly as well"
        return Verdict("ambiguous", reason, complete)
    return Verdict("likely", _why_likely(grades), complete)


def _is_within_reach(leading: Graded, rules: Rules) -> bool:
    """Return whether a rival of the leading effect predicts as well: within one standard error."""
    return any(x.deviations <= rules.standard_errors for x in leading.near_rivals)


def _why_likely(grades: Grades) -> str:
    """Return why the leading effects are not certain: rivals that are not excluded, or an unexplained residual."""
    first = "nothing else that was tried predicts unseen readings"
    open_ = list(dict.fromkeys(y.id for x in grades.effects for y in x.open_rivals))
    if open_:
        return f"{first} better, but {listed(open_)} {'is' if len(open_) == 1 else 'are'} not excluded"
    for doubt, said in DOUBTS.items():
        if ids := [x.id for x in grades.effects if x.doubt == doubt]:
            return f"{first} as well, but {said.format(listed(ids))}"
    if not grades.complete:
        return f"{first} as well, but a part of the residual stays unexplained"
    return f"{first} as well, but not so clearly that it is certain"


def _without_effects(searched: Searched, rules: Rules) -> Verdict:
    archive, base, best = searched.archive, searched.base, searched.best
    if not is_complete(archive, rules, base, best):
        if not rules.is_relevant(archive, best):
            return _immaterial(searched, rules)
        if not extremes_at_floor(best, archive.problem, archive.noise_um):
            reason = "some consecutive readings differ from the simulation by more than noise"
            return Verdict("unexplained", reason, complete=False)
        return Verdict("unexplained", "nothing that was tried predicts unseen readings better", complete=False)
    if best.hypothesis.own is not None:
        return Verdict("recalibrated", "numbers of the model were off; nothing else is missing")
    if calibration_matters(archive, base, rules):
        return Verdict("recalibrated", "gain and offset of the reading were off; nothing else is missing")
    return Verdict("no_gap", "simulation and measurement differ by noise alone")


def _immaterial(searched: Searched, rules: Rules) -> Verdict:
    """More than noise is left, but less than what anybody would miss."""
    reason = f"the residual is above the noise, but below {100.0 * rules.relevant:g} % of the stroke (--relevant)"
    is_other = searched.best.hypothesis.own is not None or calibration_matters(searched.archive, searched.base, rules)
    return Verdict("recalibrated" if is_other else "no_gap", reason, complete=False)


def calibration_matters(archive: Archive, base: Fitted, rules: Rules) -> bool:
    """Return whether gain and offset change the readings by a part of the noise that is worth a word."""
    problem = archive.problem
    readings = problem.readings(base.hypothesis)
    if readings is None:
        return False
    rows = sum(int(x.judging.sum()) for x in problem.observations)
    given = sum(
        float(((x.measured_um - y)[x.judging] ** 2).sum()) for x, y in zip(problem.observations, readings, strict=True)
    )
    gained = given / max(rows, 1) - residual_square_um2(problem, base, judged=True)
    return math.isfinite(gained) and gained > rules.matters**2 * floor_square_um2(problem, archive.noise_um)
