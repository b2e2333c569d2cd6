"""Rows that are missing: which way the command took between those around the pause is not known.

The expectation keeps the last command up to the next row. Here the device goes other ways through the pause: straight
from command to command, and aside for some of the missing rows. What each reads beyond the expectation is a column, as
of the pasts of a record.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bender_plant.model import Model
from bender_watch.baseline.courses import Courses

MOST_MISSING = 1 << 62
WAYS: tuple[tuple[float, int, int], ...] = (
    (0.0, 0, 0), (1.0, 1, MOST_MISSING), (1.0, 1, 2), (1.0, 3, 8),
    (1.0, 9, 32), (0.25, 1, MOST_MISSING), (1.0, 33, MOST_MISSING), (-1.0, 1, MOST_MISSING),
)  # fmt: skip
"""The straight way, and ways aside: how far, and between which missing rows, counted from the end of the pause.

`FAR` and `QUARTER` of the courses are in their places.
"""
MOST_COMMANDS = 64
"""Of the straight way."""
TWICE = 2.0
"""Deviations of a step that a way aside takes at every row: the command is led away, and does not stray."""


@dataclass(slots=True)
class Pause:
    """The ways through the last pause.

    Attributes:
        model: of the device; None for an FMU.
        linear: the command runs straight from row to row.
        range_V: commands that the device has seen.
        least_um: what matters.
        interval_s: from row to row.
        step_V: of the command from row to row, rms.
        courses: what the ways add.
    """

    model: Model | None
    linear: bool
    range_V: tuple[float, float]
    least_um: float
    interval_s: float
    step_V: float
    courses: Courses = field(init=False)

    def __post_init__(self) -> None:
        self.courses = Courses(self.model, self.linear, len(WAYS), self.least_um)

    def pass_over(self, own: Any, before: tuple[float, float], after: tuple[float, float]) -> bool:
        """Go all ways from a row to the next one; return whether they differ.

        A way goes as far aside as the command is led by as many steps as there are from the nearer end of the pause.

        Args:
            own: state of a stream of the device at the row before the pause.
            before: time in s and command in V of that row.
            after: the same of the row behind the pause.
        """
        (begin_s, begin_V), (end_s, end_V) = before, after
        missing = round((end_s - begin_s) / self.interval_s) - 1
        if missing < 1 or (self.step_V == 0.0 and begin_V == end_V):
            return False
        was_over = self.courses.is_over
        streams = self.courses.begin()
        if not streams:
            return False
        for stream in streams if was_over else ():
            stream.restore(own)
        for stream, (aside, first, last) in zip(streams[1:], WAYS, strict=True):
            if first <= missing:
                shares, way_V = self._way(aside, first, min(last, missing), missing, end_V - begin_V)
                low, high = min(self.range_V[0], begin_V, end_V), max(self.range_V[1], begin_V, end_V)
                stream.advance(begin_s + shares * (end_s - begin_s), np.clip(begin_V + way_V, low, high))
        return True

    def _way(self, aside: float, first: int, last: int, missing: int, moved_V: float) -> tuple[np.ndarray, np.ndarray]:
        """Return where in the pause, as parts of it, commands come, and how far from the last one before it."""
        if first == 0:
            count = min(missing, MOST_COMMANDS)
            shares = np.arange(1, count + 1) / (count + 1)
            return shares, moved_V * shares
        from_end = 0.5 * (first + last)
        far_V = min(
            TWICE * self.step_V * min(from_end, missing + 1 - from_end), 0.5 * (self.range_V[1] - self.range_V[0])
        )
        # at the end of the pause the command of the next row takes over
        edges, way_V = ([last], [far_V]) if first == 1 else ([last, first - 1], [far_V, 0.0])
        return 1.0 - np.array(edges) / (missing + 1), aside * np.array(way_V)
