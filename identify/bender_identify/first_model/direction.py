"""Whether a record runs the other way: what is called the reading leads, and what is called the input follows it.

The input of a device in open loop does not depend on earlier readings, while its readings do depend on earlier inputs.
Each is foretold some rows ahead, on blocks that the weights have not seen, from its own past and from the past of both.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bender_loop.records.record import Record

Array = NDArray[np.float64]

LAGS = (0, 1, 2, 4, 8, 16, 32)
"""Rows back from the last one that is known."""
AHEAD = (1, 2, 4, 8, 16, 32)
"""Rows from the last one that is known to the one that is foretold."""
FOLDS, BLOCKS = 5, 10
LEAST_ROWS, MOST_ROWS = 300, 20_000
LITTLE = 0.85
"""Of the square that the own past leaves: earlier inputs that leave more of a reading say next to nothing of it."""
MUCH = 0.4
"""Earlier readings that leave less of an input, on every part of the record, say most of what is new in it."""
NEW = 0.05
"""Of the square of the readings: less that their own past leaves is noise of a course that foretells itself."""
_RIDGE, _EXACT = 1e-9, 1e-6


class Direction(NamedTuple):
    """What the past of one column adds to what the past of the other foretells, at the distance where it adds most.

    Attributes:
        reading: square that is left of the readings with earlier inputs, as a part of that without them.
        command: the same of the inputs with earlier readings, where it is largest among the parts of the record.
    """

    reading: float
    command: float


def direction(command: Array, reading: Array) -> Direction | None:
    """Return which column follows which, None where rows are too few or nothing in one of the columns is new.

    Args:
        command: (n,) inputs.
        reading: (n,) readings at these rows; NaN where one is missing.
    """
    read = np.flatnonzero(np.isfinite(reading))
    if len(read) < LEAST_ROWS:
        return None
    reading = np.interp(np.arange(len(reading)), read, reading[read])
    columns = [x[:MOST_ROWS] for x in (command, reading)]
    spreads = [float(np.std(x)) for x in columns]
    if min(spreads) <= 0.0:
        return None
    u, y = (np.asarray((x - np.mean(x)) / spread, np.float64) for x, spread in zip(columns, spreads, strict=True))
    forth, back = [], []
    for ahead in AHEAD:
        own, with_input = _left(y, u, ahead)
        if float(np.median(own)) >= NEW:
            forth.append(float(np.median(with_input / own)))
            alone, with_reading = _left(u, y, ahead)
            back.append(float(np.max((with_reading + _EXACT) / (alone + _EXACT))))
    return Direction(min(forth), min(back)) if forth else None


def _left(target: Array, other: Array, ahead: int) -> tuple[Array, Array]:
    """Return (FOLDS,) the square that its own past leaves of a column, and that which the past of both leaves."""
    rows = np.arange(LAGS[-1], len(target) - ahead)
    fold = (np.arange(len(rows)) * BLOCKS // len(rows)) % FOLDS
    own, both = (np.column_stack([x[rows - lag] for x in xs for lag in LAGS]) for xs in ([target], [target, other]))
    wanted = target[rows + ahead]
    return _squares(own, wanted, fold), _squares(both, wanted, fold)


def _squares(known: Array, wanted: Array, fold: NDArray[np.intp]) -> Array:
    """Return (FOLDS,) the mean square of what linear weights of the other folds leave on each."""
    known = np.column_stack([known, np.ones(len(known))])
    left = np.empty(FOLDS)
    for k in range(FOLDS):
        seen, unseen = known[fold != k], known[fold == k]
        normal = seen.T @ seen
        normal += _RIDGE * np.trace(normal) / len(normal) * np.eye(len(normal))
        weights = np.linalg.solve(normal, seen.T @ wanted[fold != k])
        left[k] = np.mean((wanted[fold == k] - unseen @ weights) ** 2)
    return left


def direction_sentence(records: Sequence[Record]) -> str:
    """Return what is said where the inputs of all records follow the readings; "" elsewhere, and in closed loops."""
    if any(x.setpoint_um is not None for x in records):
        return ""
    found = [direction(x.voltage_V, x.displacement_um) for x in records]
    if not all(x is not None and x.reading > LITTLE and x.command < MUCH for x in found):
        return ""
    told = max((x for x in found if x is not None), key=lambda x: x.command)
    return (
        f"the input follows the reading: on unseen blocks earlier readings remove {100 * (1 - told.command):.0f} % of "
        f"what is new in the input, earlier inputs {100 * max(1 - told.reading, 0.0):.0f} % of what is new in the "
        "reading. If input and reading are swapped, exchange them in --columns"
    )
