"""Turns a search written as a generator into an optimiser with ask and tell."""

import math
from dataclasses import replace

import numpy as np

from bender_tuner.optimisers.search import Point, Probe, Search, SearchFunction, Task


class AskTell:
    """Implements `Optimiser` over a generator function.

    The search advances inside `ask`, never in `tell`: the last value told costs nothing, and an error of the
    algorithm appears where its next point is wanted. A search that has converged is begun anew at a random point of
    the unit box.
    """

    def __init__(self, search: SearchFunction, task: Task) -> None:
        self._search_function = search
        self._task = task
        self._search: Search | None = None
        self._pending: Probe | None = None
        self._answer = math.nan
        self._closed = False
        self._best_x: Point = np.full(task.dimension, np.nan)
        self._best_f = math.inf
        self._credited = 0
        self._evaluations = 0

    @property
    def best_x(self) -> Point:
        """The best point told so far, shape (d,); NaN before the first one."""
        return self._best_x.copy()

    @property
    def best_f(self) -> float:
        """The value at `best_x`; inf before the first one."""
        return self._best_f

    @property
    def evaluations(self) -> int:
        """How many values were told."""
        return self._evaluations

    def ask(self) -> Point:
        """The next point to evaluate; the same one until its value is told. RuntimeError after `close`."""
        if self._closed:
            raise RuntimeError("this optimiser was closed: create a new one to search on")
        if self._pending is None:
            self._pending = self._advance()
        return self._pending.x.copy()

    def tell(self, x: Point, f: float) -> None:
        """Answer the last `ask`; NaN counts as inf. ValueError if `x` is not the point asked for."""
        if self._pending is None or not np.array_equal(x, self._pending.x):
            expected = "a call of ask first" if self._pending is None else f"the point {self._pending.x.tolist()}"
            raise ValueError(f"tell must answer the last ask: expected {expected}, found x = {x!r}")
        self._answer = math.inf if math.isnan(f) else float(f)
        self._evaluations += 1
        if self._pending.credited:
            self._credit(self._pending.x, self._answer)
        self._pending = None

    def close(self) -> None:
        """End the search and whatever thread it holds; the best point stays readable."""
        self._closed = True
        if self._search is not None:
            self._search.close()
            self._search = None

    def _advance(self) -> Probe:
        try:
            if self._search is not None:
                return self._search.send(self._answer)
        except StopIteration:
            self._task = replace(self._task, start=self._task.rng.random(self._task.dimension))
        self._search = self._search_function(self._task)
        try:
            return next(self._search)
        except StopIteration:
            raise RuntimeError(f"{self._search_function.__module__} ended without asking for a single point") from None

    def _credit(self, x: Point, f: float) -> None:
        if self._credited == 0 or f < self._best_f:
            self._best_x, self._best_f = x.copy(), f
        self._credited += 1
