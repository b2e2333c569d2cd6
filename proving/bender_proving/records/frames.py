"""Frames that went wrong: tips misread by some micrometres, one frame at a time, and frames that are lost."""

import math

import numpy as np
from bender_proving.cases.hidden import Sensor
from bender_proving.physics.lobatto import Array
from numpy.random import Generator
from numpy.typing import NDArray

_ERROR_UM: dict[Sensor, tuple[float, float]] = {"camera": (1.5, 20.0), "vibrometer": (0.5, 10.0)}
_LONGEST_LOSS = 4


def spoil(reading_um: Array, sensor: Sensor, outlying: float, lost: float, rng: Generator) -> Array:
    """A copy with round(outlying n) isolated errors and round(lost n) values nan; the first row stays as it is."""
    spoiled = np.array(reading_um, dtype=np.float64)
    gone = _lost_rows(len(spoiled), round(lost * len(spoiled)), rng)
    spoiled[gone] = np.nan
    rows = _isolated_rows(len(spoiled), round(outlying * len(spoiled)), gone, rng)
    low, high = (math.log(value) for value in _ERROR_UM[sensor])
    spoiled[rows] += rng.choice([-1.0, 1.0], len(rows)) * np.exp(rng.uniform(low, high, len(rows)))
    return spoiled


def _lost_rows(rows: int, wanted: int, rng: Generator) -> NDArray[np.intp]:
    gone: set[int] = set()
    while len(gone) < wanted:
        first = int(rng.integers(1, rows))
        length = 1 if rng.random() < 0.7 else int(rng.integers(2, _LONGEST_LOSS + 1))
        gone.update(range(first, min(rows, first + length, first + wanted - len(gone))))
    return np.array(sorted(gone), dtype=np.intp)


def _isolated_rows(rows: int, wanted: int, gone: NDArray[np.intp], rng: Generator) -> NDArray[np.intp]:
    """Rows no two of which are neighbours, taken in a random order from those that are not lost."""
    taken = np.zeros(rows + 2, dtype=bool)
    lost = np.zeros(rows, dtype=bool)
    lost[gone] = True
    chosen: list[int] = []
    for row in rng.permutation(np.arange(1, rows)):
        if len(chosen) == wanted:
            break
        if not lost[row] and not taken[row : row + 3].any():
            taken[row + 1] = True
            chosen.append(int(row))
    return np.array(sorted(chosen), dtype=np.intp)
