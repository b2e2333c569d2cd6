"""Readings that are set aside by what a hypothesis leaves, and those taken back that late time stamps explain."""

import math
from dataclasses import replace

import numpy as np

from bender_inference.fitting.fit_problem import FitProblem
from bender_inference.fitting.output_error import Fitted
from bender_inference.records.observations import Array, Observations
from bender_inference.search.noise import shares_of_noise
from bender_loop.records.outliers import outlying


def with_outlying_aside(problem: FitProblem, fitted: Fitted, noise_um: float) -> tuple[FitProblem, int]:
    """Return the problem with isolated readings set aside and others taken back, and how many changed."""
    changed = 0
    kept = []
    for r, x, own_um in _rows(problem, fitted, noise_um):
        whole = replace(x, usable=np.isfinite(x.measured_um))
        after = whole.without(outlying(whole, r, own_um))
        changed += int(np.count_nonzero(after.usable != x.usable))
        kept.append(after)
    return (problem.observing(kept) if changed else problem), changed


def with_late_stamps(problem: FitProblem, fitted: Fitted, noise_um: float) -> FitProblem:
    """Return the problem with the readings taken back that are off by no more than late time stamps explain."""
    kept, changed = [], False
    for r, x, own_um in _rows(problem, fitted, noise_um):
        whole = replace(x, usable=np.isfinite(x.measured_um))
        again = x.usable | ~outlying(whole, r, own_um, without_late=True) & whole.usable
        changed |= bool(np.any(again != x.usable))
        kept.append(replace(x, usable=again))
    return problem.observing(kept) if changed else problem


def _rows(problem: FitProblem, fitted: Fitted, noise_um: float) -> list[tuple[Array, Observations, float]]:
    """Return residual, observations and noise of every record."""
    shares = shares_of_noise(fitted, problem)
    rows = zip(fitted.residuals, problem.observations, shares, strict=True)
    return [(r, x, noise_um * math.sqrt(share)) for r, x, share in rows]
