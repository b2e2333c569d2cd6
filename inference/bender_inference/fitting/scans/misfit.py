"""The square of a residual beside the numbers of a hypothesis, and the valleys of a misfit."""

import numpy as np

from bender_inference.fitting.standing import Standing
from bender_inference.records.observations import Array


def square_beside(residual: Array, beside: Standing | None) -> float:
    """Return the sum of squares of a residual (n,), but for what the numbers of a hypothesis would take over."""
    return float(residual @ residual) if beside is None else beside.square(residual)


def deepest_valleys(squares: Array, keep: int) -> list[int]:
    """Return the indices of the deepest local minima."""
    padded = np.concatenate([[np.inf], squares, [np.inf]])
    local = np.nonzero((squares <= padded[:-2]) & (squares <= padded[2:]))[0]
    return [int(k) for k in local[np.argsort(squares[local])][:keep]]
