"""The step of a quantiser is known to within a cell: there every command stays on its level.

While no command u changes its level n = round(u / s), the voltages are s n, and what a smaller step s takes away a
larger gain gives back: no reading tells one step of the cell from another,

    max |u| / (n + 1/2) <= s <= min |u| / (n - 1/2).

The middle is as good as any other step of the cell, and is the same whatever units the commands came in. Where the
plant is not linear, the readings do tell: then the cell does not apply.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.output_error import Fitted, judge
from bender_inference.records.observations import Array

SAME = 1e-9
"""Part of the square by which two steps of a cell may differ that fit alike."""
ENDS = (0.05, 0.95)
"""Places in the cell, in parts of its width, that are looked at: at the very ends rounding decides."""


def cell_V(commands_V: Sequence[Array], step_V: float) -> tuple[float, float]:
    """Return the smallest and the largest step at which every command stays on its level; inf where none ends it."""
    u = np.abs(np.concatenate(commands_V))
    n = np.rint(u / step_V)
    above = n >= 1.0
    low = float(np.max(u / (n + 0.5), initial=0.0))
    return low, float(np.min(u[above] / (n[above] - 0.5), initial=math.inf))


@dataclass(frozen=True, slots=True)
class Cell:
    """The cell of a quantiser's step, and which free number of a hypothesis that is."""

    number: int
    low_V: float
    high_V: float

    def beside(self, step_V: float) -> tuple[float, float]:
        """Return a step below and one above, both in the cell, a quarter of its width away or as far as it goes."""
        width = self.high_V - self.low_V
        low, high = (self.low_V + part * width for part in ENDS)
        return max(min(step_V - width / 4.0, high - width / 4.0), low), min(max(step_V + width / 4.0, low), high)

    def variance(self, step_V: float) -> float:
        """Return the mean square by which steps evenly spread over the cell differ from one, in parts of it."""
        off_V = step_V - 0.5 * (self.low_V + self.high_V)
        return ((self.high_V - self.low_V) ** 2 / 12.0 + off_V**2) / step_V**2


def cell_of(problem: FitProblem, fitted: Fitted) -> Cell | None:
    """Return the cell of the step of a quantiser among the free numbers of a hypothesis.

    None where there is none, or where the commands run between their levels.
    """
    drives = [x.drive for x in problem.observations]
    jumping = [free.jumps for x in fitted.hypothesis.parts for free in x.form.free]
    if True not in jumping or any(x.linear or x.smooth for x in drives):
        return None
    k = jumping.index(True)
    low, high = cell_V([x.voltage_V for x in drives], fitted.hypothesis.values()[k])
    return Cell(k, low, high) if low < high < math.inf else None


def is_undetermined(problem: FitProblem, fitted: Fitted, cell: Cell, variance: float) -> bool:
    """Return whether the readings leave the cell open: at its ends the square rises by no more than one variance.

    That is the rise of a standard deviation; a step that the readings determine more closely has slopes that say so.
    """
    steps = (cell.low_V + part * (cell.high_V - cell.low_V) for part in ENDS)
    ends = (_moved(problem, fitted, cell.number, x) for x in steps)
    return all(x is not None and x.training_square <= fitted.training_square + variance for x in ends)


def centred(problem: FitProblem, fitted: Fitted) -> Fitted:
    """Return a hypothesis with the step of its quantiser in the middle of its cell, if that fits as well."""
    cell = cell_of(problem, fitted)
    if cell is None:
        return fitted
    middle = _moved(problem, fitted, cell.number, 0.5 * (cell.low_V + cell.high_V))
    if middle is None or middle.training_square > (1.0 + SAME) * fitted.training_square:
        return fitted
    return replace(middle, covariance=fitted.covariance)


def _moved(problem: FitProblem, fitted: Fitted, k: int, value: float) -> Fitted | None:
    values = list(fitted.hypothesis.values())
    values[k] = value
    return judge(problem, fitted.hypothesis.with_values(values))
