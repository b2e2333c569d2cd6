"""Where the commands leave what the training record has seen, and where they have come back for good."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bender_watch.baseline.learn import Range
from bender_watch.held import Block, Event

INSIDE_AGAIN = 64
"""Rows inside the training range after which an excursion is over, twice as many for each further one: every crest of a
sine is no news, however slow it is."""


@dataclass(slots=True)
class Excursions:
    """The excursions so far.

    Attributes:
        rows: outside the range.
        is_out: one has begun and is not over.
        inside: rows since the last one outside.
        over_after: rows inside after which the next one is over.
    """

    rows: int = 0
    is_out: bool = False
    inside: int = 0
    over_after: int = INSIDE_AGAIN

    def take(self, known: Range, block: Block, before: int, units: Event) -> Iterator[Event]:
        """Take rows behind so many others; yield what there is to say, with the units of its numbers."""
        rows, beyond = block.rows, block.beyond
        self.rows += int(beyond.sum())
        begin = 0
        for k in [*np.flatnonzero(beyond).tolist(), len(rows)]:
            back = begin + self.over_after - self.inside - 1
            if self.is_out and back < k:
                self.is_out, self.over_after = False, 2 * self.over_after
                yield {"event": "inside_again", "row": before + back + 1, "time_s": float(rows.time_s[back])}
            if k == len(rows):
                self.inside += k - begin
                break
            if not self.is_out:
                yield {
                    "event": "outside_training_range", "row": before + k + 1, "time_s": float(rows.time_s[k]),
                    "voltage_V": float(rows.voltage_V[k]), "expected_um": float(block.expected_um[k]),
                    "range_V": [known.low_V, known.high_V], "range_um": [known.low_um, known.high_um],
                } | units  # fmt: skip
            self.is_out, self.inside, begin = True, 0, k + 1
