"""Readings that a tracker or a logger got wrong: isolated ones far from what a simple structure simulates.

A handful of them, each a few strokes off, outweighs all other readings in a fit by least squares. Where a reading
stands apart from its neighbours, those are set aside that do so in what the best simple structure leaves.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bender_identify.first_model.choice import structures_scored
from bender_identify.first_model.excerpt import excerpts
from bender_identify.first_model.fit import CANNOT_BE, Array, FirstFit, FitTask, Mask, evaluated
from bender_identify.first_model.structures import Structure
from bender_identify.records.experiment import Experiment
from bender_identify.records.memory import memory_s
from bender_loop.records.outliers import EXCEPTIONS, deviation, outlying

SIMPLE = Structure(lags=1, modes=1)
TURNS = 3
"""Fits in turn: without what the first one set aside, the next one sees smaller ones."""
SAME = 1e-9
"""Of the span of the readings: closer ones are one level of a coarse sensor."""


@dataclass(frozen=True, slots=True, eq=False)
class _Readings:
    measured_um: Array
    usable: Mask
    half_step_um: float
    course_V: Array
    places: NDArray[np.intp]


def without_misread(experiments: Sequence[Experiment]) -> list[Experiment]:
    """Return experiments with the readings set aside that no simple structure leads to and no neighbour shares."""
    read = [_readings_of(x) for x in experiments]
    kept = list(experiments)
    suspected = [_standing_apart(x, x.measured_um) for x in read]
    if not any(x.any() for x in suspected):
        return kept
    for _ in range(TURNS):
        left = _left_by_simple(experiments, kept)
        if left is None:
            return list(experiments)
        misread = [_standing_apart(x, r) for x, r in zip(read, left, strict=True)]
        again = [_without(x, m, s) for x, m, s in zip(experiments, misread, suspected, strict=True)]
        before, kept = kept, again
        if all(a.misread_s == b.misread_s for a, b in zip(before, kept, strict=True)):
            break
    return kept


def lacking(x: Experiment, misread: Mask) -> Experiment:
    """Return an experiment without some readings (n,)."""
    measured_um = np.where(misread, np.nan, x.measured_um)
    fitted, held_out = x.fitted & ~misread, x.held_out & ~misread
    return replace(
        x, measured_um=measured_um, fitted=fitted, held_out=held_out, misread_s=tuple(x.time_s[misread].tolist())
    )


def _without(x: Experiment, misread: Mask, suspected: Mask) -> Experiment:
    """Return an experiment without some readings; where they are too many, without those that stand apart anyway."""
    most = max(EXCEPTIONS * float((x.fitted | x.held_out).sum()), 1.0)
    misread = misread if misread.sum() <= most else misread & suspected
    return x if misread.sum() > most else lacking(x, misread)


def _readings_of(x: Experiment) -> _Readings:
    usable = x.fitted | x.held_out
    levels = np.diff(np.unique(x.measured_um[usable]))
    levels = levels[levels > SAME * float(np.ptp(x.measured_um[usable]))]
    half_step_um = 0.5 * float(levels.min()) if levels.size else 0.0
    return _Readings(x.measured_um, usable, half_step_um, x.acting_V, np.arange(usable.size))


def _standing_apart(x: _Readings, residual: Array) -> Mask:
    """Return the rows whose residual stands alone, by how much neighbours differ as a rule."""
    known = residual[x.usable]
    return outlying(x, residual, deviation(np.diff(known)) / np.sqrt(2.0))


def memory_of(experiments: Sequence[Experiment]) -> float:
    """Return how long in s the simple structure that fits best answers a command; 0 where none can be simulated."""
    try:
        best = _best_simple(experiments)
        return memory_s(best.structure.model(best.values))
    except CANNOT_BE:
        return 0.0


def _best_simple(experiments: Sequence[Experiment]) -> FirstFit:
    scores = structures_scored(FitTask.of(excerpts(experiments), rough=True), only=SIMPLE)
    return min(scores, key=lambda x: x.held_out_rms).fit


def _left_by_simple(experiments: Sequence[Experiment], kept: Sequence[Experiment]) -> list[Array] | None:
    """Return what the simple structure that fits kept readings best leaves of all; None where none can be simulated."""
    try:
        best = _best_simple(kept)
        whole = FitTask.of(experiments, rough=True)
        fit = evaluated(whole, best.structure, best.values, [x.fitted | x.held_out for x in kept])
    except CANNOT_BE:
        return None
    return None if fit is None else list(fit.residuals)
