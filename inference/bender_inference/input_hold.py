"""What the command does between the rows, decided by the records: held, straight from row to row, or band-limited.

It is held, as a supply holds it, unless the model as given, recalibrated, fits the records far better with another
course: by evidence that decides, and by closing most of the gap, as effects must to be named. Less than that may be
what a missing effect has in common with another course; where one is missing beside it, the course has to be told.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bender_inference.fitting.criterion import independent_rows, very_strong
from bender_inference.fitting.fit_problem import COARSER, MOST_SUBSTEPS, FitProblem, problem_of
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.output_error import Fitted, fit, judge
from bender_inference.records.excerpt import excerpts
from bender_inference.records.observations import observe
from bender_inference.records.spectrum import are_even
from bender_inference.search.judgement.rules import RULES
from bender_inference.search.noise import noise_of, residual_square_um2
from bender_inference.search.search import Searched
from bender_inference.settings import Settings
from bender_loop.records.record import Record
from bender_plant.model import Model
from bender_plant.plant import sub_step_bounds_s

OTHERS = ("linear", "smooth")
"""Courses of a command beside the held one."""
MOST_LEADERS = 4
"""Hypotheses that are fitted on another course after every step of a search."""


def decide_input_hold(base: Model, records: Sequence[Record], how: Settings) -> Settings:
    """Return the settings with what the command does between the rows decided, where it is to be.

    Args:
        base: the model as given.
        records: of one bench.
        how: they are read.
    """
    if not how.decide_hold:
        return how
    is_open = not how.untimed and all(_moves(x) for x in records) and _is_affordable(base, records)
    held = _recalibrated(base, records, how, "hold") if is_open else None
    best, left = "hold", math.inf
    # a smooth course is one through even rows
    for hold in ("linear", "smooth") if all(are_even(x.time_s) for x in records) else ("linear",):
        other = None if held is None else _recalibrated(base, records, how, hold)
        if held is None or other is None or not _is_far_better(other, held, how):
            continue
        square = residual_square_um2(other[0], other[1])
        if square < left:
            best, left = hold, square
    return replace(how.between_rows(best), decide_hold=True)


class OtherCourseError(Exception):
    """What a search has found fits far better with another course between the rows; `how` reads the records so."""

    def __init__(self, how: Settings) -> None:
        super().__init__(how.input_hold)
        self.how = how


def better_course(found: Searched, records: Sequence[Record], how: Settings) -> Settings | None:
    """Return the settings with another course between the rows, where what was found fits far better with it.

    What leaves structure on a held command may be the right effect on another course: the leaders are fitted on each.
    """
    problem, best = found.archive.problem, found.best
    if not best.hypothesis.parts or not _is_open(found, records, how):
        return None
    left = {}
    for hold in OTHERS:
        told = how.between_rows(hold)
        courses = [replace(x.drive, linear=told.linear, smooth=told.smooth) for x in problem.observations]
        seen = [replace(x, drive=y) for x, y in zip(problem.observations, courses, strict=True)]
        other = problem_of(problem.base, tuple(seen))
        fits = [x for x in (fit(other, y.hypothesis, kept=False) for y in _leaders(found)) if x is not None]
        fitted = min(fits, key=lambda x: x.training_square, default=None)
        if fitted is not None and _is_far_better((other, fitted), (problem, best), how):
            left[hold] = residual_square_um2(other, fitted)
    return _closest(left, how)


def course_of_another_effect(
    found: Searched, records: Sequence[Record], how: Settings, searched: Callable[[Settings], Searched]
) -> Settings | None:
    """Return the settings with another course, where one effect on it fits far better than all that was found.

    On a held command a search that ends with structure left may never have fitted the effect that is missing.

    Args:
        found: by a search that left structure.
        records: that were searched.
        how: they were read.
        searched: returns what a search for one effect finds with other settings.
    """
    if not _is_open(found, records, how):
        return None
    held, left = (found.archive.problem, found.best), {}
    for hold in OTHERS:
        one = searched(how.between_rows(hold))
        if _is_far_better((one.archive.problem, one.best), held, how):
            left[hold] = residual_square_um2(one.archive.problem, one.best)
    return _closest(left, how)


def _is_open(found: Searched, records: Sequence[Record], how: Settings) -> bool:
    """Return whether the command is held because nothing showed another course, and another can be simulated."""
    if not how.decide_hold or how.input_hold != "hold" or how.untimed:
        return False
    if not all(_moves(x) and are_even(x.time_s) for x in records):
        return False
    return _is_affordable(found.best.hypothesis.model(found.archive.problem.base), records)


def _closest(left: Mapping[str, float], how: Settings) -> Settings | None:
    """Return the settings with the course that leaves least; None without one."""
    return replace(how.between_rows(min(left, key=lambda x: left[x])), decide_hold=True) if left else None


def _leaders(found: Searched) -> list[Fitted]:
    """Return what was found, and the fits of other effects that leave least."""
    leaders = {frozenset(found.best.hypothesis.effects): found.best}
    for x in found.archive.by_fit():
        if len(leaders) == MOST_LEADERS:
            break
        if x.hypothesis.parts:
            leaders.setdefault(frozenset(x.hypothesis.effects), x)
    return list(leaders.values())


def _moves(record: Record) -> bool:
    """Return whether a command changes from row to row: one that stays the same over most rows is held."""
    return 2 * int(np.count_nonzero(np.diff(record.voltage_V))) >= len(record)


def _is_affordable(base: Model, records: Sequence[Record]) -> bool:
    """Return whether a course that never stands still can be simulated: it needs sub-steps all the way."""
    duration_s = sum(float(np.ptp(x.time_s)) for x in records)
    return duration_s < COARSER * MOST_SUBSTEPS * sub_step_bounds_s(base)[1]


_Found = tuple[FitProblem, Fitted]


def _recalibrated(base: Model, records: Sequence[Record], how: Settings, hold: str) -> _Found | None:
    told = how.between_rows(hold)
    whole = [observe(x, told.linear, smooth=told.smooth) for x in records]
    problem = problem_of(base, tuple(x.seen() for x in excerpts(whole)))
    fitted = judge(problem, Hypothesis())
    return None if fitted is None else (problem, fitted)


def _is_far_better(other: _Found, held: _Found, how: Settings) -> bool:
    problem, fitted = other
    noise = noise_of(fitted, problem) ** 2
    squares = [max(residual_square_um2(y, x), 1e-300) for y, x in (held, other)]
    above, rest = (max(x - noise, 0.0) for x in squares)
    gained = independent_rows(problem, fitted) * math.log(squares[0] / squares[1])
    return rest < (1.0 - RULES.closes) * above and gained > very_strong(how.confidence)
