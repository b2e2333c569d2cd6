"""What each fold of a record is for: fitted, chosen on, or reported on.

Of a short record a fold is one block of consecutive rows. Of a long one it is several, far from one another: what
happens once, such as the strong part of an earthquake, is then fitted, chosen on and reported on alike.

The folds that are held out are a stratified sample (Neyman 1934, doi:10.2307/2342192): of all choices that keep them
apart, the one whose command is most like that of the whole record in level, spread, changes and time. So a gap on them
is that of the record, also where the command stands still for most of the time.
"""

from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.intp]

BLOCKS = 20
REPORTED, CHOSEN = 3, 4
"""Blocks that no choice sees, and blocks that no fit sees but choices do."""
MOST_STRETCHES, LEAST_READINGS = 4, 300
"""Of a fold, and in each stretch: more than a residual is correlated over, as a rule."""
APART, FIRST = 2, 1
"""Blocks of one kind are so far from one another at least; the first one is fitted: the record begins there."""


def blocks_of(read: Mask) -> NDArray[np.int64]:
    """Return which of twenty blocks of consecutive rows with as many readings every row is in, shape (n,).

    Args:
        read: (n,) which rows have a reading.
    """
    return _stretches(read, BLOCKS)


def folds_of(read: Mask) -> NDArray[np.int64]:
    """Return which of twenty folds every row is in, shape (n,).

    Args:
        read: (n,) which rows have a reading.
    """
    count = min(max(int(np.count_nonzero(read)) // (BLOCKS * LEAST_READINGS), 1), MOST_STRETCHES)
    return _stretches(read, count * BLOCKS) % BLOCKS


def _stretches(read: Mask, count: int) -> NDArray[np.int64]:
    """Return which of so many stretches of consecutive rows with as many readings every row is in."""
    before = np.maximum(np.cumsum(read) - 1, 0)
    return np.minimum(before * count // max(int(np.count_nonzero(read)), 1), count - 1)


def held_out_and_reported(read: Mask, command_V: Array) -> tuple[Mask, Mask]:
    """Return which rows no fit sees, and which of them no choice sees either.

    Args:
        read: (n,) which rows have a reading.
        command_V: (n,) command of every row.
    """
    blocks = folds_of(read)
    likeness = _features(blocks, command_V)
    reported = _most_alike(likeness, _choices(REPORTED, 2 * APART + 1))
    free = [x for x in _choices(CHOSEN, APART) if np.min(np.abs(np.subtract.outer(x, reported))) >= 1]
    chosen = _most_alike(likeness, np.array(free, dtype=np.intp))
    return np.isin(blocks, (*reported, *chosen)), np.isin(blocks, reported)


@cache
def _choices(count: int, apart: int) -> Numbers:
    """Return all choices of so many blocks that lie apart, shape (c, count)."""
    found = [x for x in combinations(range(FIRST, BLOCKS), count) if min(np.diff(x)) >= apart]
    return np.array(found, dtype=np.intp)


def _most_alike(features: Array, choices: Numbers) -> Numbers:
    """Return the choice whose mean features are nearest to nought, those of the whole."""
    off = np.sum(np.square(features[choices].mean(axis=1)), axis=1)
    return choices[int(np.argmin(off))]


def _features(blocks: NDArray[np.int64], command_V: Array) -> Array:
    """Return what the command does in every block, about that of the whole and in deviations, shape (20, k)."""
    change = np.abs(np.diff(command_V, prepend=command_V[:1]))
    level = command_V - command_V.mean()
    rows = np.maximum(np.bincount(blocks, minlength=BLOCKS), 1)
    columns = [np.bincount(blocks, weights=x, minlength=BLOCKS) / rows for x in (level, level**2, change, change**2)]
    found = np.stack([*columns, np.arange(BLOCKS, dtype=np.float64)], axis=1)
    found -= found.mean(axis=0)
    spread = found.std(axis=0)
    return found / np.where(spread > 1e-12 * np.maximum(np.abs(found).max(axis=0), 1e-300), spread, np.inf)
