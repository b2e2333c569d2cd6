"""Lowest and highest level of late, at a cost that does not grow with the number of levels."""

import math
from collections import deque


class RecentRange:
    """What a level has been within a time before now; each holds until the next one.

    Args:
        span_s: so far back.
    """

    def __init__(self, span_s: float) -> None:
        self._span_s = span_s
        self._levels: deque[tuple[float, float]] = deque()
        # what can still become the lowest or the highest: an older level that the newest one beats never will
        self._low: deque[tuple[float, float]] = deque()
        self._high: deque[tuple[float, float]] = deque()

    def add(self, time_s: float, level: float) -> None:
        """Take a level that holds from `time_s`, which is not before that of any other."""
        entry = (time_s, level)
        self._levels.append(entry)
        while self._low and self._low[-1][1] >= level:
            self._low.pop()
        while self._high and self._high[-1][1] <= level:
            self._high.pop()
        self._low.append(entry)
        self._high.append(entry)

    def since_s(self, now_s: float) -> float:
        """Return from when on the levels of the time before `now_s` are known; infinity for none at all."""
        self._forget(now_s)
        return self._levels[0][0] if self._levels else math.inf

    def range(self, now_s: float) -> tuple[float, float]:
        """Return the lowest and the highest level within the time before `now_s`, the one that held first included."""
        self._forget(now_s)
        return self._low[0][1], self._high[0][1]

    def _forget(self, now_s: float) -> None:
        levels, since_s = self._levels, now_s - self._span_s
        while len(levels) > 1 and levels[1][0] <= since_s:
            gone = levels.popleft()
            for kept in (self._low, self._high):
                if kept[0] is gone:
                    kept.popleft()
