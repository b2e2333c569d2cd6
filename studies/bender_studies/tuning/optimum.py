"""The optimum that the methods are held against: many searches, in the methods' box and in a wider one.

First differential evolution (scipy) with several seeds over both boxes, then Nelder-Mead (scipy) from the best points
of each, as far apart as they lie, begun anew whenever its simplex has shrunk. All are cut off at a number of
evaluations, so that the work is known beforehand. None of them sees what the methods found.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.optimize import differential_evolution, minimize

from bender_studies.tuning.method_runs import gain_values
from bender_studies.tuning.plants import Problem
from bender_tuner.optimisers.search import WORST, Point
from bender_tuner.task.search_space import DIMENSION, SearchSpace

WIDENINGS = (1.0, 2.0)
FEWEST_EVALUATIONS = 64
SEEDS = 4
STARTS = 4
_APART_DECADES = 0.3
_SIMPLEX_DECADES = 0.1
_POPULATION = 10
_BOUNDS = [(0.0, 1.0)] * DIMENSION


class _SpentError(Exception):
    """The evaluations of a search are used up."""


@dataclass(frozen=True, slots=True)
class SearchEnd:
    """Where one search came to.

    Attributes:
        kind: global search, or polish from a start.
        widening: of the box that was searched, 1 for that of the methods.
        best_um2: smallest MSE.
        gains: Kp, Ki, Kd there.
        starts: points of the box worth polishing, the best one first, then the best ones away from it.
    """

    kind: Literal["global", "polish"]
    widening: float
    best_um2: float
    gains: tuple[float, float, float]
    starts: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class SearchTask:
    """A search to be done: call it with the problem. Without a start it is a global one."""

    widening: float
    seed: int
    weight: int
    start: tuple[float, ...] | None = None

    def __call__(self, problem: Problem) -> SearchEnd:
        """Search until `weight` evaluations are spent."""
        box = problem.box(self.widening)
        meter = _Meter(problem, box, self.weight)
        rng = np.random.default_rng(self.seed)
        try:
            while True:
                if self.start is None:
                    _evolve(meter, rng)
                else:
                    _polish(meter, np.array(self.start), rng)
        except _SpentError:
            starts = meter.starts(_APART_DECADES / (2.0 * box.decades))
        kind = "global" if self.start is None else "polish"
        return SearchEnd(kind, self.widening, meter.best, gain_values(box, starts[0]), _as_tuples(starts))


@dataclass(frozen=True, slots=True)
class Optimum:
    """What the searches agree on.

    Attributes:
        best_um2: the smallest MSE of all.
        gains: Kp, Ki, Kd there.
        box_um2: the smallest in the box of the methods.
        wide_um2: the smallest in the wider box.
        evaluations: spent on all searches together.
        polishes: how many searches polished.
        agreeing: how many of them ended within 0.1 % of the best of their box.
    """

    best_um2: float
    gains: tuple[float, float, float]
    box_um2: float
    wide_um2: float
    evaluations: int
    polishes: int
    agreeing: int


def global_tasks(evaluations: int) -> list[SearchTask]:
    """The first half of `evaluations`, in global searches."""
    if evaluations < FEWEST_EVALUATIONS:
        raise ValueError(f"optimum_evaluations must be >= {FEWEST_EVALUATIONS}, found {evaluations!r}")
    share = math.ceil(evaluations / (4 * SEEDS))
    return [SearchTask(widening, seed, share) for widening in WIDENINGS for seed in range(SEEDS)]


def polish_tasks(ends: Iterable[SearchEnd], evaluations: int) -> list[SearchTask]:
    """The second half, from what the global searches found."""
    starts = [(end.widening, start) for end in ends for start in end.starts]
    share = math.ceil(evaluations / (2 * len(starts)))
    return [SearchTask(widening, seed, share, start) for seed, (widening, start) in enumerate(starts)]


def agree(ends: Iterable[SearchEnd], evaluations: int) -> Optimum:
    """The optimum from all searches; `evaluations` is what they spent."""
    ends = list(ends)
    best = min(ends, key=lambda end: end.best_um2)
    lowest = {widening: min(end.best_um2 for end in ends if end.widening == widening) for widening in WIDENINGS}
    narrow, wide = lowest.values()
    polishes = [end for end in ends if end.kind == "polish"]
    agreeing = sum(end.best_um2 <= 1.001 * lowest[end.widening] for end in polishes)
    return Optimum(best.best_um2, best.gains, narrow, wide, evaluations, len(polishes), agreeing)


@dataclass(slots=True)
class _Meter:
    """The objective, counted and remembered."""

    problem: Problem
    box: SearchSpace
    left: int
    points: list[Point] = field(default_factory=list)
    values: list[float] = field(default_factory=list)

    def __call__(self, x: Point) -> float:
        if self.left == 0:
            raise _SpentError
        self.left -= 1
        point = np.clip(x, 0.0, 1.0)
        value = min(self.problem.value(self.box, point), WORST)
        self.points.append(point)
        self.values.append(value)
        return value

    @property
    def best(self) -> float:
        return min(self.values)

    def starts(self, apart: float) -> list[Point]:
        """The best point, then the best ones at least `apart` from those before; fewer where there are none."""
        chosen: list[Point] = []
        for index in np.argsort(self.values):
            point = self.points[index]
            if all(np.linalg.norm(point - other) >= apart for other in chosen):
                chosen.append(point)
            if len(chosen) == STARTS:
                break
        return chosen


def _evolve(objective: Callable[[Point], float], rng: np.random.Generator) -> None:
    differential_evolution(objective, _BOUNDS, popsize=_POPULATION, init="sobol", polish=False, tol=1e-6, rng=rng)


def _polish(meter: _Meter, start: Point, rng: np.random.Generator) -> None:
    """Nelder-Mead from the best point known, on a simplex that is turned anew at every call."""
    best = meter.points[int(np.argmin(meter.values))] if meter.points else start
    edge = _SIMPLEX_DECADES / (2.0 * meter.box.decades)
    turned, _ = np.linalg.qr(rng.standard_normal((DIMENSION, DIMENSION)))
    corners = np.clip(np.vstack([best, best + edge * turned]), 0.0, 1.0)
    options = {"initial_simplex": corners, "xatol": 1e-6, "fatol": 1e-12, "maxfev": 10_000, "maxiter": 10_000}
    minimize(meter, best, method="Nelder-Mead", bounds=_BOUNDS, options=options)


def _as_tuples(points: list[Point]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(point.tolist()) for point in points)
