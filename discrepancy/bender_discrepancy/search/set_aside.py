"""Readings set aside by what a hypothesis leaves, and everything counted anew without them."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bender_discrepancy.fitting.fit_problem import FitProblem
from bender_discrepancy.fitting.output_error import Fitted, fit, recounted
from bender_discrepancy.records.observations import Array, Observations
from bender_discrepancy.records.outliers import outlying
from bender_discrepancy.search.state import Found, noise_of, shares_of_noise

# turns in which readings are set aside: without some the noise is smaller, and others stand out
MOST_SETTLINGS = 3


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


def _rows(problem: FitProblem, fitted: Fitted, noise_um: float) -> list[tuple[Array, Observations, float]]:
    """Return residual, observations and noise of every record."""
    shares = shares_of_noise(fitted, problem)
    rows = zip(fitted.residuals, problem.observations, shares, strict=True)
    return [(r, x, noise_um * math.sqrt(share)) for r, x, share in rows]


def with_late_stamps(problem: FitProblem, fitted: Fitted, noise_um: float) -> FitProblem:
    """Return the problem with the readings taken back that are off by no more than late time stamps explain."""
    kept, changed = [], False
    for r, x, own_um in _rows(problem, fitted, noise_um):
        whole = replace(x, usable=np.isfinite(x.measured_um))
        again = x.usable | ~outlying(whole, r, own_um, without_late=True) & whole.usable
        changed |= bool(np.any(again != x.usable))
        kept.append(replace(x, usable=again))
    return problem.observing(kept) if changed else problem


def determined_with_late_stamps(found: Found) -> Found:
    """Return what was found with the numbers of the best hypothesis from all rows that are off by late stamps only."""
    problem = with_late_stamps(found.problem, found.best, found.noise_um)
    if problem is found.problem:
        return found
    best = fit(problem, found.best.hypothesis, kept=False)
    if best is None:
        return found
    best = recounted(best, found.problem)
    return replace(found, best=best, steps=(*found.steps[:-1], best))


def settled(found: Found) -> Found:
    """Return what was found with outlying readings set aside by what the best hypothesis leaves, counted anew."""
    problem, best, noise_um = found.problem, found.best, found.noise_um
    for _ in range(MOST_SETTLINGS):
        problem, changed = with_outlying_aside(problem, best, noise_um)
        if changed:
            best = fit(problem, best.hypothesis) or best
        noise_um = min(noise_um, noise_of(best, problem))
        if not changed:
            break
    best = recounted(best, problem)
    steps = (*(recounted(x, problem) for x in found.steps[:-1]), best)
    base = recounted(found.base, problem)
    return replace(found, problem=problem, base=base, best=best, noise_um=noise_um, steps=steps)


def to_the_end(found: Found) -> Found:
    """Return what was found with the best hypothesis fitted to the end: a search stops where no choice looks closer."""
    best = fit(found.problem, found.best.hypothesis, closely=True) if found.best.hypothesis.free else None
    if best is None or best.training_square >= found.best.training_square:
        return found
    return settled(replace(found, best=best, steps=(*found.steps[:-1], best)))


def cleared(found: Found, tried: Sequence[Fitted], leader: Fitted) -> tuple[Found, list[Fitted], Fitted]:
    """Set readings aside by what the leader leaves, and count everything without them.

    What is misread, and how large the noise is, show best where least structure is left; every estimate of the noise
    errs upwards where some is.
    """
    problem, changed = with_outlying_aside(found.problem, leader, found.noise_um)
    counted = list(tried)
    if changed:
        again = fit(problem, leader.hypothesis) or leader
        counted = [again if x is leader else recounted(x, problem) for x in tried]
        leader = again
        base, best = recounted(found.base, problem), recounted(found.best, problem)
        steps = (*(recounted(x, problem) for x in found.steps[:-1]), best)
        found = replace(found, problem=problem, base=base, best=best, steps=steps)
    return replace(found, noise_um=min(found.noise_um, noise_of(leader, problem))), counted, leader
