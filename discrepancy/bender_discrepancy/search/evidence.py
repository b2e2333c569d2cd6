"""The few constants that decide what is said, and the tests that they enter.

What a hypothesis leaves is noise and the inadequacy of its forms; `criterion` weighs differences by one likelihood of
both. Two questions that likelihood cannot answer, since an inadequacy is no sample of noise: whether a further effect
only mops up what the form of another one leaves, and whether anything is left at all.

Forms of the catalogue are not nature's to the last percent of the gap, and some are far more flexible than others. What
a flexible one gains on that last percent is no evidence for its name.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bender_discrepancy.fitting.criterion import CONFIDENCE, Yardstick, cost, held_gain
from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.records.noise import floor_ratio_limit
from bender_discrepancy.records.observations import turns_plays
from bender_discrepancy.records.outliers import FAR
from bender_discrepancy.search.state import (
    Found,
    readings_square_um2,
    rms_um,
    shares_of_noise,
    shows_in_the_readings,
    square_um2,
)


@dataclass(frozen=True, slots=True)
class Evidence:
    """The constants; decision 6 says where each comes from and what else was tried.

    Attributes:
        confidence: one minus the family-wise error rate of every test.
        inadequacy: variance of what a form may leave, in parts of the gap it closes (a fifth of its size, squared, and
            a margin): another effect must remove more, or most of the residual.
        mopped_up: part of another form's inadequacy that an effect may take up by chance.
        closes: part of the gap's variance that effects must close to be named while structure is left: what stays is
            then below a third of the gap's size.
        least_rest: over the square of the noise; beside an effect, no other one is sought in less.
        form_within: part of the gap's size within which a far simpler hypothesis is as good as a flexible one.
        fewer_numbers: what makes it far simpler.
        matters: of the noise; a calibration that changes readings by less, or steps of a sensor that leave less, are
            not worth a verdict.
    """

    confidence: float = CONFIDENCE
    inadequacy: float = 0.05
    mopped_up: float = 0.5
    closes: float = 0.9
    least_rest: float = 1.0
    form_within: float = 0.01
    fewer_numbers: int = 3
    matters: float = 0.5

    def __post_init__(self) -> None:
        if not 0.5 <= self.confidence < 1.0:
            raise ValueError(f"confidence must be from 0.5 to below 1, found {self.confidence!r}")


EVIDENCE = Evidence()


def floor_square_um2(problem: FitProblem, noise_um: float) -> float:
    """Return the square that no model could go below: the noise, and the steps of coarse readings."""
    steps = [(2.0 * x.half_step_um) ** 2 / 12.0 for x in problem.observations]
    return noise_um**2 + sum(steps) / len(steps)


def floor_limit(problem: FitProblem, confidence: float) -> float:
    """Return how many times the square of the floor the mean square of noise alone may be, on the rows of choices."""
    judged = sum(int(x.judging.sum()) for x in problem.observations)
    return floor_ratio_limit(problem.all_rows, max(judged, 1), 1.0 - confidence)


def energy_at_floor(fitted: Fitted, problem: FitProblem, noise_um: float, confidence: float) -> bool:
    """Return whether the mean square of the residual is no larger than that of noise alone, by chance included.

    Every record has a noise of its own, and its own share of the rows that choices are made on.
    """
    rows = [int(x.judging.sum()) for x in problem.observations]
    shares = zip(shares_of_noise(fitted, problem), rows, strict=True)
    noise = noise_um**2 * sum(share * count for share, count in shares) / max(sum(rows), 1)
    floor = floor_square_um2(problem, math.sqrt(noise))
    return rms_um(fitted, problem) ** 2 <= floor_limit(problem, confidence) * floor


def extremes_at_floor(fitted: Fitted, problem: FitProblem, noise_um: float) -> bool:
    """Return whether no reading is left as far off as an outlying one: isolated ones have been set aside before."""
    rows = zip(fitted.residuals, problem.observations, shares_of_noise(fitted, problem), strict=True)
    return all(
        float(np.max(np.abs(r[x.searched]), initial=0.0))
        <= FAR * math.sqrt(floor_square_um2(problem, noise_um * math.sqrt(share)))
        for r, x, share in rows
    )


def is_small(fitted: Fitted, found: Found, by: Evidence) -> bool:
    """Return whether the residual is small beside the noise and steps of the readings, and beside the gap.

    A gap of about the noise has to be closed as far as any other, unless chance explains the residual. The few blocks
    of choices need not hold what shows a missing effect: the blocks that fits see count as well.
    """
    floor = floor_square_um2(found.problem, found.noise_um)
    square = max(readings_square_um2(found.problem, fitted, all_rows=x) for x in (False, True))
    if square > (1.0 + by.least_rest) * floor:
        return False
    return square <= floor_limit(found.problem, by.confidence) * floor or closed_share(found, fitted) >= by.closes


def exceeds_the_noise(fitted: Fitted, found: Found, by: Evidence) -> bool:
    """Return whether more is left than as much again as the noise, on the rows of choices and on all of them."""
    floor = floor_square_um2(found.problem, found.noise_um)
    squares = (readings_square_um2(found.problem, fitted, all_rows=x) for x in (False, True))
    return min(squares) > (1.0 + by.least_rest) * floor


def is_finished(fitted: Fitted, found: Found, by: Evidence) -> bool:
    """Return whether nothing is left in which another effect could be sought.

    The model as given must leave noise alone, of coarse readings nothing beyond their steps. One with an effect, whose
    form is not nature's, may leave as much again as the noise and the steps of the readings.
    """
    if fitted.hypothesis.parts and is_small(fitted, found, by):
        return True
    square = rms_um(fitted, found.problem) ** 2
    if square > floor_limit(found.problem, by.confidence) * found.noise_um**2:
        return False
    return extremes_at_floor(fitted, found.problem, found.noise_um)


def gap_square_um2(found: Found) -> float:
    """Return the mean square above the noise that the model as given leaves, its own linear numbers fitted."""
    return max(square_um2(found.base, found.problem) - found.noise_um**2, 0.0)


def is_material(before: Fitted, after: Fitted, found: Found, by: Evidence) -> bool:
    """Return whether a further effect removes more than it could mop up of the inadequacy of the others' forms.

    Every row that fits and choices see counts: the few blocks of choices need not hold what shows an effect.
    """
    floor, gap = found.noise_um**2, gap_square_um2(found)
    rest, left = (max(square_um2(x, found.problem) - floor, 0.0) for x in (before, after))
    if before.hypothesis.parts and is_small(before, found, by):
        return False
    return rest - left >= min(by.mopped_up * rest, by.inadequacy * gap) and rest > left


def is_enough(found: Found, best: Fitted, by: Yardstick, evidence: Evidence) -> bool:
    """Return whether the evidence for a hypothesis is enough to put it in the place of the best one so far.

    The rows of choices alone must show it as well: what a record shows in one place, its beginning say, any effect that
    passes quickly explains.
    """
    problem = found.problem
    if not cost(best, by) - cost(found.best, by) < -by.threshold or held_gain(found.best, best, by) <= by.threshold:
        return False
    return shows_in_the_readings(problem, found.best, best) and is_material(found.best, best, found, evidence)


def removes_most(before: Fitted, after: Fitted, found: Found, by: Evidence) -> bool:
    """Return whether a further effect removes more of what is above the noise than any effect could mop up."""
    rest, left = (max(square_um2(x, found.problem) - found.noise_um**2, 0.0) for x in (before, after))
    return left <= (1.0 - by.mopped_up) * rest


def may_be_mopped_up(before: Fitted, after: Fitted, found: Found, by: Evidence) -> bool:
    """Return whether an effect beside others removes no more than any effect could of the residual of their forms.

    At the end of a search no other effect is missing. The residual without this one is then its own contribution, the
    inadequacy of the other forms, and noise. Sizes (rms) are compared, not squares.
    """
    gap = gap_square_um2(found)
    rest, left = (square_um2(x, found.problem) for x in (before, after))
    return left > (1.0 - by.mopped_up) ** 2 * rest and rest - left < by.inadequacy * gap


def closed_share(found: Found, fitted: Fitted) -> float:
    """Return the part of the gap's variance above the floor that a hypothesis closes, at most 1.

    Every row that fits and choices see counts: a gap, and what a form leaves of it, is larger in some blocks.
    """
    floor = floor_square_um2(found.problem, found.noise_um)
    squares = (readings_square_um2(found.problem, x, all_rows=True) for x in (found.base, fitted))
    gap, left = (max(x - floor, 0.0) for x in squares)
    return 1.0 - left / gap if gap > 0.0 else 0.0


def simplest_as_good(ranked: Sequence[Fitted], base: Fitted, *, nothing_left: bool) -> Fitted:
    """Return the best hypothesis, or a far simpler one that is as good but for what the form of an effect may leave.

    A flexible form follows what the form of another effect leaves of it; that is no evidence for its name. Where the
    best leaves noise alone, the last percent of the gap decides. Where structure is left in any case, the simpler one
    may leave as much of the gap as its form may be off: the next effect is sought in that, and a flexible form that
    has taken it up would hide it.

    Args:
        ranked: hypotheses, best first.
        base: the model as given.
        nothing_left: whether the best leaves noise alone.
    """
    best = ranked[0]
    share = EVIDENCE.form_within**2 if nothing_left else EVIDENCE.inadequacy
    within = share * (total_square(base) - total_square(best))
    return next((x for x in ranked if is_overtaken(best, x, within)), best)


def is_overtaken(flexible: Fitted, simple: Fitted, within: float = math.inf) -> bool:
    """Return whether a far simpler hypothesis leaves hardly more than a flexible one."""
    fewer = flexible.hypothesis.free_count - simple.hypothesis.free_count
    return fewer >= EVIDENCE.fewer_numbers and total_square(simple) - total_square(flexible) <= within


def is_with_a_loop(other: Fitted, best: Fitted, problem: FitProblem) -> bool:
    """Return whether another hypothesis is the best one and more: in the place of a curve, that curve and a loop.

    Records that turn no play hold nothing that tells a loop from a curve.
    """
    theirs, own = set(other.hypothesis.effects), set(best.hypothesis.effects)
    curves = own - theirs
    loops = [x for x in other.hypothesis.parts if x.form.beside in curves]
    is_one_more = len(curves) == 1 and bool(loops) and theirs - own == {loops[0].form.effect}
    return is_one_more and turns_plays(problem.observations)


def is_plainer(rival: Fitted, best: Fitted, base: Fitted) -> bool:
    """Return whether a rival has fewer numbers than the best, and leaves more by no more than the last percent."""
    return rival.hypothesis.free_count < best.hypothesis.free_count and is_within_last_percent(rival, best, base)


def is_within_last_percent(rival: Fitted, best: Fitted, base: Fitted) -> bool:
    """Return whether a rival leaves more than the best by no more than the last percent of the gap's size.

    The forms of the catalogue are not nature's to that, nor is what two blocks make of each other.
    """
    within = EVIDENCE.form_within**2 * (total_square(base) - total_square(best))
    return total_square(rival) - total_square(best) <= within


def total_square(fitted: Fitted) -> float:
    """Return the sum of squares over all rows that fits and choices see."""
    return fitted.training_square + fitted.held_square
