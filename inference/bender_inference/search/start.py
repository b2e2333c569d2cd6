"""How a record begins, weighed with what a search has found: from rest, in motion, or at a place on the loop.

An effect fitted to a wrong beginning explains that beginning: a drift that dies within the first rows, say. So each
other beginning is tried with the effects that were found, and with one of them less. All are weighed on the same
readings. Fits to a record that was in motion before see none of them while the mode may ring from before; there, free
ringing of the modes is taken from what the fit leaves, and its numbers are paid for.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bender_inference.fitting.criterion import cost, price, yardstick
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import Fitted, fit, recounted
from bender_inference.records.initial_motion import beginnings
from bender_inference.records.observations import Observations
from bender_inference.records.ringing import free_ringing, rung_out
from bender_inference.search.budget import BUDGET
from bender_inference.search.judgement.rules import Rules, above_floor_um2
from bender_inference.search.noise import floor_square_um2
from bender_inference.search.search import Searched
from bender_loop.records.initial_motion import starts_at_rest


def better_beginning(found: Searched, from_rest: Sequence[Observations], rules: Rules) -> FitProblem | None:
    """Return the problem with the beginning that fits clearly better; None where none does.

    A record whose first commands are 0 V begins at rest unless most of the residual is at its start: otherwise
    another beginning could stand in for a missing effect.

    Args:
        found: what a search has found.
        from_rest: of every record, its observations from rest; none where the beginning is known.
        rules: the constants.
    """
    best: FitProblem | None = None
    most, problem = rules.very_strong, found.archive.problem
    for record, rest in enumerate(from_rest):
        now = problem.observations[record]
        rests = now.start == "rest" and starts_at_rest(rest.command_V)
        if rests and not _moves_at_once(found, rules, record):
            continue
        outlying = rest.usable & ~now.usable & np.isfinite(now.measured_um)
        whole = replace(rest, usable=rest.usable & ~outlying, half_step_um=now.half_step_um)
        before = _followed(problem, record, whole, found.best)
        for hypothesis in _shorter(found.best.hypothesis):
            for other in beginnings(whole, hypothesis.model(problem.base, record)):
                if other.start == now.start != "from_voltage":
                    continue
                begun = _observing(problem, record, other)
                again = fit(begun, hypothesis, BUDGET.first_evaluations)
                after = None if again is None else _followed(begun, record, whole, again)
                if after is not None and (gained := _gained(before, after, rules.confidence)) > most:
                    best, most = begun, gained
    return best


def _moves_at_once(found: Searched, rules: Rules, record: int) -> bool:
    """Return whether most of the residual above the noise is at the start, where the mode may still ring.

    It must also exceed what imperfect forms of the effects found so far may leave.
    """
    archive = found.archive
    seen, residual = archive.problem.observations[record], found.best.residuals[record]
    later = rung_out(seen, found.best.hypothesis.model(archive.problem.base, record)).searched
    early = seen.searched & ~later
    if not early.any() or not later.any():
        return False
    first, rest = float(np.mean(residual[early] ** 2)), float(np.mean(residual[later] ** 2))
    floor = floor_square_um2(archive.problem, archive.noise_um)
    above = [float(m.sum()) * max(x - floor, 0.0) for m, x in ((early, first), (later, rest))]
    if above[0] < rules.remainder * sum(above):
        return False
    if found.best.hypothesis.parts and first - rest < rules.inadequacy * above_floor_um2(archive, found.base):
        return False
    ratio = first / max(rest, 1e-300)
    # twice the log-likelihood of two variances over that of one
    gained = float(early.sum()) * (ratio - 1.0 - math.log(max(ratio, 1e-300)))
    return ratio > 1.0 and gained > rules.very_strong


@dataclass(frozen=True, slots=True, eq=False)
class _Followed:
    """A fitted hypothesis on all readings of a record, and how many numbers the free ringing took."""

    problem: FitProblem
    fitted: Fitted
    numbers: int


def _followed(problem: FitProblem, record: int, whole: Observations, fitted: Fitted) -> _Followed:
    """Return a fitted hypothesis on all readings of a record: free ringing taken from those that its fit did not see.

    Args:
        problem: that it was fitted to.
        record: of which all readings are to count.
        whole: observations with all of them.
        fitted: the hypothesis.
    """
    seen = problem.observations[record]
    rings = whole.usable & ~seen.usable
    on_all = _observing(problem, record, replace(seen, usable=whole.usable, measured_um=whole.measured_um))
    if not rings.any():
        return _Followed(on_all, recounted(fitted, on_all), 0)
    readings = problem.readings(fitted.hypothesis)
    assert readings is not None
    residuals = on_all.residuals(readings, fitted.calibration)
    ringing = free_ringing(fitted.hypothesis.model(problem.base, record), whole.time_s)[rings]
    numbers, *_ = np.linalg.lstsq(ringing, residuals[record][rings])
    residuals[record][rings] -= ringing @ numbers
    # and the voltage that the plant stood at
    count = numbers.size + int(seen.start == "from_voltage")
    return _Followed(on_all, recounted(replace(fitted, residuals=tuple(residuals)), on_all), count)


def _gained(before: _Followed, after: _Followed, confidence: float) -> float:
    """Return by how much the second beginning lowers the criterion, weighed with what the better one leaves."""
    better = min(before, after, key=lambda x: x.fitted.training_square + x.fitted.held_square)
    by = yardstick(better.problem, better.fitted, 1, confidence)
    first, second = (cost(x.fitted, by) + price(x.numbers, by.effective_rows) for x in (before, after))
    return first - second


def _observing(problem: FitProblem, record: int, seen: Observations) -> FitProblem:
    observations = list(problem.observations)
    observations[record] = seen
    return problem.observing(observations)


def _shorter(hypothesis: Hypothesis) -> Sequence[Hypothesis]:
    """Return a hypothesis, and it with each of its effects less."""
    return [hypothesis, *(hypothesis.minus(k) for k in range(len(hypothesis.parts)))]
