"""A device on other courses beside the expected one, row by row, until what they add has faded."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bender_compiled.stream import Stream
from bender_plant.model import Model
from bender_watch.baseline.candidates import COARSER

Array = NDArray[np.float64]

FAR, QUARTER = 1, 5
"""Courses of which one is a fourth of the other, where a device is linear."""
BENDS = 3.0
"""Times by which a sum of courses may be further off than a fourth of one."""
AMPLITUDE = 1.0
"""Deviation of the amplitude of a course."""
FADED, FADED_ROWS = 1e-3, 256
"""Of the noise: a course that adds less over so many rows is forgotten."""
AT_ONCE = 256
"""Rows after which it is looked whether the courses have faded."""


def doubt_of(added_um: Array, noise_um: float) -> Array:
    """Return by how many deviations of the noise rows (n,) may be off on a course that is no sum of these.

    A device is as far from linear as they show themselves.
    """
    return BENDS * np.abs(added_um[:, QUARTER] - 0.25 * added_um[:, FAR]) / noise_um


@dataclass(slots=True)
class Courses:
    """The expected course and others.

    Attributes:
        model: of the device; None for an FMU, which has no other courses.
        linear: the command runs straight from row to row.
        count: of the others.
        least_um: what matters.
    """

    model: Model | None
    linear: bool
    count: int
    least_um: float
    _made: list[Stream] = field(init=False)
    _streams: list[Stream] = field(default_factory=list[Stream], init=False)
    _quiet: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        models = [] if self.model is None else [self.model] * (self.count + 1)
        self._made = [Stream((x,), self.linear, COARSER) for x in models]

    @property
    def is_over(self) -> bool:
        """Whether all have faded."""
        return not self._streams

    def begin(self) -> list[Stream]:
        """Return the streams of all courses, the expected one first, which go on from now; none for an FMU."""
        self._streams, self._quiet = self._made, 0
        return self._streams

    def end(self) -> None:
        """Let go of all."""
        self._streams = []

    def advance(self, time_s: Array, voltage_V: Array, command_time_s: Array | None) -> Array:
        """Return what each course adds to the readings (n, count) in um, 0 from where all have faded."""
        added = np.zeros((time_s.size, self.count))
        for begin in range(0, time_s.size, AT_ONCE):
            if not self._streams:
                break
            part = slice(begin, begin + AT_ONCE)
            acting_s = None if command_time_s is None else command_time_s[part]
            added[part] = self._added(time_s[part], voltage_V[part], acting_s)
        return added

    def _added(self, time_s: Array, voltage_V: Array, command_time_s: Array | None) -> Array:
        own, *others = (x.advance(time_s, voltage_V, command_time_s)[0] for x in self._streams)
        added = np.column_stack(others) - own[:, None]
        rows = np.arange(time_s.size)
        loud = np.max(np.abs(added), axis=1) > FADED * self.least_um
        quiet = rows - np.maximum.accumulate(np.where(loud, rows, -1 - self._quiet))
        self._quiet = int(quiet[-1])
        if np.any(quiet > FADED_ROWS):
            added[int(np.argmax(quiet > FADED_ROWS)) :] = 0.0
            self.end()
        return added

    def state(self) -> Any:
        """Return what is remembered, as JSON can hold it."""
        return [self._quiet, [x.state() for x in self._streams]]

    def restore(self, state: Any) -> None:
        """Go on from a state."""
        self._quiet, own = state
        self._streams = self._made if own else []
        for stream, known in zip(self._streams, own, strict=True):
            stream.restore(known)
