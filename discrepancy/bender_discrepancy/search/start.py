"""How a record begins, weighed with what a search has found: from rest, in motion, or at a place on the loop.

An effect fitted to a wrong beginning explains that beginning: a drift that dies within the first rows, say. So each
other beginning is tried with the effects that were found, and with one of them less.
"""

from collections.abc import Sequence
from dataclasses import replace

from bender_discrepancy.fitting.criterion import cost, very_strong, yardstick
from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.hypothesis import Hypothesis
from bender_discrepancy.fitting.output_error import fit
from bender_discrepancy.records.observations import Observations
from bender_discrepancy.search.budget import BUDGET
from bender_discrepancy.search.state import Found

# of every record, the observations with each beginning that it may have
Beginnings = tuple[tuple[Observations, ...], ...]


def begun_better(found: Found, beginnings: Beginnings) -> FitProblem | None:
    """Return the problem with the beginning that fits clearly better; None where none does.

    Readings that were set aside stay so: which ones are isolated is not a matter of the beginning.
    """
    best: FitProblem | None = None
    by = yardstick(found.problem, found.best, 1, found.yardstick.confidence)
    least = cost(found.best, by) - very_strong(by.confidence)
    for record, among in enumerate(beginnings):
        now = found.problem.observations[record]
        for other in among:
            if other.start == now.start:
                continue
            seen = list(found.problem.observations)
            seen[record] = _as_counted(other, now)
            problem = found.problem.observing(seen)
            for hypothesis in _shorter(found.best.hypothesis):
                again = fit(problem, hypothesis, BUDGET.certified)
                if again is not None and cost(again, by) < least:
                    best, least = problem, cost(again, by)
    return best


def _shorter(hypothesis: Hypothesis) -> Sequence[Hypothesis]:
    """Return a hypothesis and, where it has several effects, each with one of them less."""
    count = len(hypothesis.parts)
    return [hypothesis, *(hypothesis.minus(k) for k in range(count) if count > 1)]


def _as_counted(other: Observations, now: Observations) -> Observations:
    return replace(other, usable=now.usable, half_step_um=now.half_step_um)
