"""What a page shows of a watch beside the run: the lines that `bender watch` adds to the folder of the run.

Two kinds of lines: `lane` has stretches of rows (time, lowest and highest residual in deviations of its noise, largest
statistic over its threshold), `said` one sentence. A `begin` in place of these is a watch that begins anew.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

WATCH = "watch.jsonl"
"""Name of the file in the folder of a run."""
KEPT = 2000
"""Stretches on a page."""
BEHIND_S = 3.0
"""Of the run: a watch that is further behind diagnoses, or has ended; the page says up to where it has looked."""

Stretch = tuple[float, float, float, float]


@dataclass(slots=True)
class WatchView:
    """A watch.

    Attributes:
        stretches: time in s, lowest and highest residual, statistic; the newest of them.
        said: the time of every sentence, and the sentence.
    """

    stretches: deque[Stretch] = field(default_factory=lambda: deque(maxlen=KEPT))
    said: list[tuple[float, str]] = field(default_factory=list)

    def take(self, entry: dict[str, Any]) -> None:
        """Take a line; what a watch that was killed says once more is known already."""
        if entry["kind"] == "begin":
            self.stretches.clear()
            self.said.clear()
        elif entry["kind"] == "lane":
            newest_s = self.stretches[-1][0] if self.stretches else float("-inf")
            self.stretches += (x for x in _stretches(entry.get("rows")) if x[0] > newest_s)
        elif entry["kind"] == "said":
            told = float(entry.get("time_s") or 0.0), str(entry.get("sentence"))
            if told not in self.said:
                self.said.append(told)

    def residual(self, begin_s: float, end_s: float) -> list[tuple[float, float]]:
        """Return the lowest and the highest residual of every stretch, one after the other, as a line."""
        return [(time_s, y) for time_s, *ends, _ in self._between(begin_s, end_s) for y in ends]

    def statistic(self, begin_s: float, end_s: float) -> list[tuple[float, float]]:
        """Return the largest statistic over its threshold."""
        return [(time_s, top) for time_s, _, _, top in self._between(begin_s, end_s)]

    def told(self, end_s: float) -> str:
        """Return what was said last, and how far the watch is behind."""
        said = [sentence for time_s, sentence in self.said if time_s <= end_s]
        if not said and not self.stretches:
            return ""
        until_s = self.stretches[-1][0] if self.stretches else 0.0
        behind = f"; looked at up to {until_s:.1f} s" if until_s < end_s - BEHIND_S else ""
        return (said[-1] if said else "no alarm") + behind

    def _between(self, begin_s: float, end_s: float) -> Iterator[Stretch]:
        return (x for x in self.stretches if begin_s <= x[0] <= end_s)


def _stretches(rows: Any) -> Iterator[Stretch]:
    """Yield the stretches of a line that are numbers."""
    for row in rows if isinstance(rows, list) else ():
        if isinstance(row, list) and len(row) == 4 and all(isinstance(x, int | float) for x in row):
            yield float(row[0]), float(row[1]), float(row[2]), float(row[3])
