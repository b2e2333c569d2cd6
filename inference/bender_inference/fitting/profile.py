"""95 % intervals by profile likelihood, where the quadratic of the standard deviations fails.

The interval of a number ends where the sum of squares, all other numbers fitted anew, has risen by

    q = z^2 S'' / 2,    z = 1.96,

S'' being its curvature along the line on which the others follow, at the standard deviation that was stated: with the
correlation and the spread of the residuals in it (`uncertainty`). Where the misfit is a parabola, these are the ends
z deviations away. It is taken for one where it rises there by what the ends of intervals of 90 to 98 % would show
(Venzon and Moolgavkar 1988, doi:10.2307/2347496; Raue and others 2009, doi:10.1093/bioinformatics/btp358).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from bender_compiled.parallel_map import parallel_map
from bender_effects.form import Free
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.hypothesis import Hypothesis, Part
from bender_inference.fitting.level_cell import cell_of
from bender_inference.fitting.output_error import Fitted, fit, judge
from bender_inference.fitting.uncertainty import Uncertainty
from bender_inference.records.observations import Array

Z = float(ndtri(0.975))
NEAR = 0.25
"""Of the way to an end: where the curvature is taken."""
LEAST_RISE, MOST_RISE = (float(ndtri(0.5 + 0.5 * p)) ** 2 / Z**2 for p in (0.90, 0.98))
TURNS, CLOSE, FURTHEST = 5, 0.1, 4.0
"""Of the search for an end: it is there within this part of the rise; no turn goes further than so many times."""
EVALUATIONS = 6
"""Of a fit of all other numbers."""
MOST_WORK = 3e8
"""Sub-steps of all profiles of a hypothesis; where they need more, the intervals are those of the parabola."""


@dataclass(frozen=True, slots=True)
class Ends:
    """The ends of a 95 % interval of one free number; `profiled` where the parabola fails and they were sought."""

    low: float
    high: float
    profiled: bool = False


def interval_ends(problem: FitProblem, fitted: Fitted, open_: Uncertainty) -> list[Ends | None]:
    """Return the interval of every free number of a hypothesis; None where the records do not determine it.

    Args:
        problem: what it was fitted to.
        fitted: the hypothesis.
        open_: the standard deviations of its numbers.
    """
    before = problem.work_substeps
    fitted = judge(problem, fitted.hypothesis) or fitted
    one_run = problem.work_substeps - before
    free, values = fitted.hypothesis.free, fitted.hypothesis.values()
    of_effects = sum(len(x.values) for x in fitted.hypothesis.parts)
    is_dear = one_run * 2 * TURNS * EVALUATIONS * (len(free) + 1) * of_effects > MOST_WORK
    cell = cell_of(problem, fitted)
    # numbers of several records have one name, by which one of them cannot be held
    records = [x.form.records for x in fitted.hypothesis.parts for _ in x.values]
    of_several = {k for k, count in enumerate(records) if count > 1}

    def ends(k: int) -> Ends | None:
        deviation = math.sqrt(max(float(open_.coordinates[k, k]), 0.0))
        if not math.isfinite(deviation):
            return None
        middle = free[k].inward(values[k])
        low, high = (free[k].outward(middle + sign * Z * deviation) for sign in (-1.0, 1.0))
        plain = Ends(low, high)
        in_the_cell = cell is not None and cell.number == k
        if is_dear or deviation == 0.0 or free[k].solved or in_the_cell or k in of_several or k >= of_effects:
            return plain
        return _Profile.of(problem, fitted, open_.coordinates, k).ends(plain)

    return parallel_map(ends, list(range(len(free))))


def may_vanish(fitted: Fitted, ends: Sequence[Ends | None]) -> tuple[int, ...]:
    """Return the effects of a hypothesis, by their index, whose one size may as well be none at all.

    Of several sizes of one effect each may be, and their sum not. What another channel shows stands.

    Args:
        fitted: the hypothesis.
        ends: of the 95 % intervals of its free numbers.
    """
    found, first = [], 0
    for k, part in enumerate(fitted.hypothesis.parts):
        own = zip(part.form.free, part.values, ends[first : first + len(part.values)], strict=True)
        sizes = [x is None or free.may_vanish(value, x.low, x.high) for free, value, x in own if free.is_size]
        first += len(part.values)
        if sizes == [True] and not part.form.shown:
            found.append(k)
    return tuple(found)


@dataclass(frozen=True, slots=True, eq=False)
class _Profile:
    """The misfit along one number.

    Attributes:
        problem: what the hypothesis was fitted to.
        fitted: the hypothesis.
        number: which of its free numbers.
        way: (k,) by how much all coordinates change from the best numbers to the upper end.
        rise: of the sum of squares at the ends of an interval.
    """

    problem: FitProblem
    fitted: Fitted
    number: int
    way: Array
    rise: float

    @classmethod
    def of(cls, problem: FitProblem, fitted: Fitted, covariance: Array, number: int) -> "_Profile":
        """Return it with the rise that the curvature at the best numbers foretells."""
        column = covariance[:, number] / covariance[number, number]
        column = [float(x) if math.isfinite(x) else 0.0 for x in column]
        way = Z * math.sqrt(float(covariance[number, number])) * np.array(column)
        found = cls(problem, fitted, number, way, 0.0)
        near = [found.moved(sign * NEAR) for sign in (-1.0, 1.0)]
        return replace(found, rise=max(sum(near) / (2.0 * NEAR**2), 0.0) if all(map(math.isfinite, near)) else 0.0)

    def moved(self, part: float) -> float:
        """Return the rise of the sum of squares a part of the way along, the others following as on a parabola."""
        free, values = self.fitted.hypothesis.free, self.fitted.hypothesis.values()
        there = [x.outward(x.inward(v) + part * float(d)) for x, v, d in zip(free, values, self.way, strict=True)]
        found = judge(self.problem, self.fitted.hypothesis.with_values(there))
        return math.inf if found is None else found.training_square - self.fitted.training_square

    def ends(self, plain: Ends) -> Ends:
        """Return the ends that a parabola has, or those that are found where the misfit is none."""
        if self.rise <= 0.0:
            return plain
        if all(LEAST_RISE <= self.moved(sign) / self.rise <= MOST_RISE for sign in (-1.0, 1.0)):
            return plain
        low, high = sorted(self._end(sign) for sign in (-1.0, 1.0))
        return Ends(low, high, profiled=True)

    def _end(self, sign: float) -> float:
        """Return the value at which the sum of squares has risen, all other numbers fitted anew."""
        free, value = self.fitted.hypothesis.free[self.number], self.fitted.hypothesis.values()[self.number]
        part, outside, inside = 1.0, math.inf, 0.0
        for _ in range(TURNS):
            there = free.outward(free.inward(value) + sign * part * float(self.way[self.number]))
            risen = self._fitted_anew(free, there)
            if abs(risen / self.rise - 1.0) <= CLOSE:
                break
            if risen > self.rise:
                outside = min(outside, part)
            else:
                inside = max(inside, part)
            further = part * math.sqrt(self.rise / max(risen, 1e-300)) if risen > 0.0 else FURTHEST * part
            further = min(max(further, part / FURTHEST), part * FURTHEST)
            part = further if inside < further < outside else 0.5 * (inside + min(outside, FURTHEST * part))
        return free.outward(free.inward(value) + sign * part * float(self.way[self.number]))

    def _fitted_anew(self, free: Free, value: float) -> float:
        held = _holding(self.fitted.hypothesis, self.number, free, value)
        found = fit(self.problem, held, EVALUATIONS, kept=False)
        return math.inf if found is None else found.training_square - self.fitted.training_square


def _holding(hypothesis: Hypothesis, number: int, free: Free, value: float) -> Hypothesis:
    """Return a hypothesis with one of its free numbers held at a value."""
    parts, first = list(hypothesis.parts), 0
    for k, part in enumerate(parts):
        place = number - first
        if 0 <= place < len(part.values):
            form = part.form.holding(free.name, value)
            parts[k] = Part(form, part.values[:place] + part.values[place + 1 :])
        first += len(part.values)
    return replace(hypothesis, parts=tuple(parts))
