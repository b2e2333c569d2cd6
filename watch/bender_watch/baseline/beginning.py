"""What came before the first row of a record, and what that may still add to its readings.

A device remembers: eq. (30) for a second or two, creep for minutes, play until it is swept again. The expectation has
stood at the first command for long. Here the model sets out from other pasts: from either end of the range, directly or
with a turn between (play remembers turns), up to the first row or some rows before it (creep remembers for how long).
What each reads beyond the expectation is a column, and a past that nobody knows is taken for a sum of them with
amplitudes of about 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bender_plant.model import Model
from bender_watch.baseline.courses import Courses
from bender_watch.baseline.expectation import rest_before_s
from bender_watch.baseline.noise import innovations
from bender_watch.sequential.detector import CLIP, Noise

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

PASTS: tuple[tuple[tuple[float, ...], int], ...] = (
    ((-1.0,), 0), ((1.0,), 0), ((1.0,), 8), ((1.0,), 64), ((1.0,), 512),
    ((0.25,), 0), ((1.0, -0.5), 0), ((-1.0, 0.5), 0),
)  # fmt: skip
"""Where the device was, one row each behind long standing, and until how many rows before the first one.

From the first command (0) to the further end of the range (1), and to the nearer one (-1).
"""
COUNT = len(PASTS)
KNOWN = 1e-9
"""Deviation of an amplitude that is known beforehand."""
ROUNDS = 8
"""Of setting rows aside and fitting again."""


@dataclass(slots=True)
class Beginning:
    """The pasts of a record, row by row.

    Attributes:
        model: of the device; None for an FMU, whose past is not looked at.
        linear: the command runs straight from row to row.
        range_V: commands that the device has seen.
        least_um: what matters.
        interval_s: from row to row.
        courses: what the pasts add.
    """

    model: Model | None
    linear: bool
    range_V: tuple[float, float]
    least_um: float
    interval_s: float
    courses: Courses = field(init=False)

    def __post_init__(self) -> None:
        self.courses = Courses(self.model, self.linear, COUNT, self.least_um)

    def begin(self, time_s: float, voltage_V: float, *, rest: bool) -> None:
        """Begin a record."""
        streams = self.courses.begin()
        if not streams:
            return
        low, high = self.range_V
        far, near = (high, low) if voltage_V - low < high - voltage_V else (low, high)
        own, *others = streams
        if rest:
            own.begin()
        else:
            own.stand(time_s - rest_before_s(own), voltage_V, time_s)
        for stream, (parts, before) in zip(others, PASTS, strict=True):
            ends = [voltage_V + abs(x) * ((far if x > 0.0 else near) - voltage_V) for x in parts]
            begin_s = time_s - (before + len(ends) - 1) * self.interval_s
            stream.stand(begin_s - rest_before_s(own), ends[0], begin_s)
            known = [*ends[1:], voltage_V] if before else ends[1:]
            if known:
                stream.advance(begin_s + self.interval_s * np.arange(len(known), dtype=np.float64), np.array(known))

    def first_um(self, time_s: Array, voltage_V: Array, command_time_s: Array | None) -> Array:
        """Return what each past adds to the first row (1, `COUNT`), which has yet to be taken."""
        known = self.courses.state()
        added = self.courses.advance(time_s, voltage_V, command_time_s)
        self.courses.restore(known)
        return added


def whitened_rows(noise: Noise, columns: Array, usable: Mask, spread: Array, gaps: Sequence[int]) -> Array:
    """Return columns (n, j) behind the filter of the noise, NaN where a row does not count.

    Args:
        noise: of the filter.
        columns: (n, j) in um.
        usable: (n,) rows that count.
        spread: (n,) factor on the deviation.
        gaps: rows that lie behind one.
    """
    ends = [0, *gaps, len(columns)]
    parts = [slice(a, b) for a, b in pairwise(ends) if b > a]
    found = np.empty(columns.shape)
    for part in parts:
        for j in range(columns.shape[1]):
            found[part, j] = innovations(noise, np.nan_to_num(columns[part, j]), usable[part], spread[part])
    return found


def fitted(e: Array, columns: Array, deviations: Array) -> tuple[Array, Array]:
    """Return amplitudes (j,) of the columns and their covariance, rows far from the fit set aside.

    Args:
        e: (n,) of unit deviation.
        columns: (n, j).
        deviations: (j,) of the amplitudes beforehand.
    """
    beforehand = np.diag(1.0 / np.maximum(deviations, KNOWN) ** 2)
    near = np.ones(e.size, bool)
    amplitudes, covariance, scale = np.zeros(deviations.size), np.diag(deviations**2), 1.0
    for _ in range(ROUNDS):
        own = columns[near]
        covariance = np.linalg.inv(own.T @ own / scale**2 + beforehand).astype(np.float64)
        amplitudes = covariance @ (own.T @ e[near]) / scale**2
        left = np.abs(e - columns @ amplitudes)
        scale = max(1.0, 1.4826 * float(np.median(left))) if e.size else 1.0
        further = left <= CLIP * scale
        if np.array_equal(further, near):
            break
        near = further
    return amplitudes, covariance
