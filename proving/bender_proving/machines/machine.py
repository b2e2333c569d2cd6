"""A machine of another field: equations with numbers drawn at random, and what is played to it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Array = NDArray[np.float64]
State = tuple[float, ...]
Slope = Callable[[State, float], State]
Respond = Callable[[Array, Array], Array]
"""Takes the times (n,) of the rows in s and the inputs (n,), each held to the next row; returns the readings (n,)."""


@dataclass(frozen=True, slots=True)
class Machine:
    """A kind of machine.

    Attributes:
        name: a word.
        missing: what its linear model lacks, in words.
        right: effects that an expert would accept as what is missing.
        wrong: effects that would be a mistake as the first name.
        row_s: between rows.
        plays: kinds of input that are usual for it.
        span: of the input, from its lowest to its highest value.
        draw: returns a machine with numbers of its own.
        unit: of the readings.
        centre: of the input.
    """

    name: str
    missing: str
    right: frozenset[str]
    wrong: frozenset[str]
    row_s: float
    plays: tuple[str, ...]
    span: float
    draw: Callable[[Generator], Respond]
    unit: str
    centre: float = 0.0


def integrated(slope: Slope, start: State, time_s: Array, drive: Array, substeps: int) -> list[State]:
    """Return the states at every row, by Heun steps of which so many lie between two rows."""
    state, states = start, [start]
    for k in range(time_s.size - 1):
        dt_s, u = float(time_s[k + 1] - time_s[k]) / substeps, float(drive[k])
        for _ in range(substeps):
            first = slope(state, u)
            second = slope(tuple(x + dt_s * v for x, v in zip(state, first, strict=True)), u)
            state = tuple(x + 0.5 * dt_s * (a + b) for x, a, b in zip(state, first, second, strict=True))
        states.append(state)
    return states


def column(states: list[State], place: int) -> Array:
    """Return one number of all states (n,)."""
    return np.array([x[place] for x in states])


def about(rng: Generator, value: float, part: float = 0.3) -> float:
    """Return a number near a value, by so large a part of it at most."""
    return value * float(rng.uniform(1.0 - part, 1.0 + part))
