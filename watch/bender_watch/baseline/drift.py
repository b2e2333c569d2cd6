"""A change that goes on: level and gain along lines of time that may bend.

Behind a change that grows, and behind a second one, nobody knows whether it stands or goes on. The slopes of level and
gain are learned with the rest from the rows since the change, along straight lines. From then on level and gain are
followed row by row, and their slopes wander as `pass_time` says. A device whose gain fades, straight or slower and
slower, is followed then, and no alarm; where it turns at once, it is one.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SLOPES = 2
"""Slopes of a drift: of the level, and of the gain."""
FOLLOWED = 2 * SLOPES
"""Columns of a drift that is followed: level and gain, and behind them their slopes."""


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """Level and gain that move; as it is made, of a device that does not drift.

    Attributes:
        length_s: of the rows that it was learned from.
        slopes: (2,) by how much the level in um, and the gain, move over this length.
        covariance: (2, 2) of the slopes.
    """

    length_s: float = math.inf
    slopes: Array = field(default_factory=lambda: np.zeros(SLOPES))
    covariance: Array = field(default_factory=lambda: np.zeros((SLOPES, SLOPES)))

    @property
    def is_followed(self) -> bool:
        """Whether the device drifts."""
        return math.isfinite(self.length_s)

    def lines_um(self, time_s: Array, expected_um: Array, middle_s: float) -> Array:
        """Return what slopes of 1 add to the readings (n, 2) that it is learned from; level and gain are of a time."""
        since = (time_s - middle_s) / self.length_s
        return np.column_stack([since, since * expected_um])

    def columns_um(self, expected_um: Array) -> Array:
        """Return what amplitudes of 1 add to the readings that follow (n, 4)."""
        columns = np.zeros((expected_um.size, FOLLOWED))
        if self.is_followed:
            columns[:, 0], columns[:, 1] = 1.0, expected_um
        return columns

    def steps(self, time_s: Array, before_s: float) -> Array:
        """Return the time before each row (n,) in lengths of the drift; none passes for a clock that was set back."""
        return np.maximum(np.diff(time_s, prepend=before_s), 0.0) / self.length_s

    def at_the_end(self) -> tuple[Array, Array]:
        """Return amplitudes (4,) and covariance (4, 4) behind the rows that it was learned from: half a length on."""
        moved = np.vstack([0.5 * np.eye(SLOPES), np.eye(SLOPES)])
        return moved @ self.slopes, moved @ self.covariance @ moved.T
