"""The level of a limit of the output, scanned by cutting off what the hypothesis gives."""

from dataclasses import replace

import numpy as np

from bender_effects.form import Form
from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.hypothesis import Hypothesis
from bender_inference.fitting.scans.misfit import deepest_valleys
from bender_inference.fitting.standing import Standing
from bender_inference.fitting.starts import readings_columns, solved, target
from bender_inference.records.observations import Array
from bender_plant.model import ModelError

PLACES, LEVELS = 60, 2
"""Levels that are tried over the range of the output, and how many of them a fit sets out from."""


def limits_where_they_promise(problem: FitProblem, base: Hypothesis, form: Form, beside: Standing | None) -> Form:
    """Return the form of a limit with levels to set out from where cutting off leaves least.

    The output may be of any size and far from its rest, which the gain and the offset behind it settle, so that shares
    of the stroke miss it. Rows beyond the level say nothing about the numbers of the hypothesis: their slopes are left
    out there.
    """
    found = _outputs(problem, base)
    if found is None:
        return form
    sign = -1.0 if form.scan == "limit below" else 1.0
    outputs = [sign * x for x in found]
    rows = np.concatenate([x[seen.training] for x, seen in zip(outputs, problem.observations, strict=True)])
    lowest, highest = max(float(rows.min()), 0.0), float(rows.max())
    if highest <= lowest:
        return form
    measured = target(problem)
    levels = lowest + (highest - lowest) * (np.arange(PLACES) + 0.5) / PLACES
    left = np.array([_left(problem, outputs, float(x), rows, measured, beside) for x in levels])
    level = form.free[0]
    places = [float(levels[k]) for k in deepest_valleys(left, LEVELS) if level.low <= levels[k] <= level.high]
    return replace(form, free=(replace(level, starts=(*level.starts, *places)), *form.free[1:]))


def _outputs(problem: FitProblem, base: Hypothesis) -> list[Array] | None:
    """Return what stands before the limit, readings without the calibration, for every record."""
    try:
        models = [base.model(problem.base, k) for k in range(len(problem.rough))]
        plain = [x.with_block("calibration", gain=1.0, offset_um=0.0) for x in models]
        return [simulator.run(x).reading_um for simulator, x in zip(problem.rough, plain, strict=True)]
    except (ModelError, ArithmeticError):
        return None


def _left(
    problem: FitProblem, outputs: list[Array], level: float, rows: Array, measured: Array, beside: Standing | None
) -> float:
    column = readings_columns(problem, [np.minimum(x, level) for x in outputs])
    if beside is None:
        return solved([column], measured)[1]
    own = beside.weighted((rows < level).astype(np.float64))
    return solved([own.without_it(column)], own.without_it(measured))[1]
