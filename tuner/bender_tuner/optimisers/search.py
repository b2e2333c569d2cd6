"""How an algorithm is written here: as a generator function over probes.

`f = yield Probe(x)` stands for "evaluate x". The algorithm then reads as its paper prints it, loops and all, and still
calls nobody; `ask_tell.AskTell` turns it inside out.
"""

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Point: TypeAlias = NDArray[np.float64]

WORST = 1e300
"""Stands for infinity where a library takes differences of values."""


class Probe(NamedTuple):
    """A point that a search wants evaluated, shape (d,); `credited` = may it become the best point."""

    x: Point
    credited: bool = True


@dataclass(frozen=True, slots=True)
class Task:
    """What every algorithm is given.

    Attributes:
        dimension: number of coordinates d.
        rng: the only source of randomness.
        start: where to begin, shape (d,), or None for the algorithm's own choice.
        budget: evaluations that the caller plans to spend; sizes populations, ends nothing.
    """

    dimension: int
    rng: np.random.Generator
    start: Point | None
    budget: int

    @property
    def population(self) -> int:
        """Members of a population that has as many generations as members within the budget, at least 8."""
        return max(8, math.isqrt(self.budget))


Search: TypeAlias = Generator[Probe, float, None]
SearchFunction: TypeAlias = Callable[[Task], Search]
