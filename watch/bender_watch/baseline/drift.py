"""A change that goes on: level and gain along straight lines of time.

Behind a change that grows, and behind a second one, nobody knows whether it stands or goes on. The slopes of level and
gain are learned with the rest from the rows since the change; where they are not known well, the rows that follow say
more of them. A device whose gain fades then is followed, and no alarm, until it stops fading or fades in another way.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SLOPES = 2
"""Columns of a drift: of the level, and of the gain."""


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """Level and gain along straight lines of time; as it is made, of a device that does not drift.

    Attributes:
        middle_s: of the rows that it was learned from: level and gain are those of then.
        length_s: of these rows.
        slopes: (2,) by how much the level in um, and the gain, move over this length.
        covariance: (2, 2) of the slopes.
    """

    middle_s: float = 0.0
    length_s: float = math.inf
    slopes: Array = field(default_factory=lambda: np.zeros(SLOPES))
    covariance: Array = field(default_factory=lambda: np.zeros((SLOPES, SLOPES)))

    @classmethod
    def over(cls, time_s: Array) -> "Drift":
        """Return a drift that is not known yet, over rows (n,)."""
        return cls(float(np.mean(time_s)), float(time_s[-1] - time_s[0]))

    @property
    def followed_s(self) -> float | None:
        """Since when it is counted; None of a device that does not drift."""
        return self.middle_s if math.isfinite(self.length_s) else None

    def columns_um(self, time_s: Array, expected_um: Array) -> Array:
        """Return what slopes of 1 add to the readings (n, 2)."""
        since = (time_s - self.middle_s) / self.length_s
        return np.column_stack([since, since * expected_um])

    def later(self, by_s: float) -> "Drift":
        """Return the same drift by a clock that shows so much more."""
        return replace(self, middle_s=self.middle_s + by_s)
