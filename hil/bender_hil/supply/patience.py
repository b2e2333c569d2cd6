"""How long whoever talks to an instrument may wait, and who is told while it waits."""

import contextlib
import math
import time
from collections.abc import Callable

SLICE_S = 0.05
"""A wait is cut into pieces of this length, so that whoever waits can show that it is alive."""


def _say_nothing() -> None:
    """Nobody has to be told."""


class Patience:
    """Shared by a link and by whoever gives it its deadline.

    Attributes:
        end_s: `time.perf_counter` after which nothing is waited for any more.
        waiting: called before each piece of a wait; what it raises ends no wait.
    """

    def __init__(self) -> None:
        self.end_s = math.inf
        self.waiting: Callable[[], None] = _say_nothing

    def left_s(self, most_s: float) -> float:
        """Return what is left of a wait of `most_s`; 0 when the deadline has passed."""
        return max(0.0, min(most_s, self.end_s - time.perf_counter()))

    def pause(self, time_s: float) -> None:
        """Wait for `time_s` in pieces, at most until the deadline."""
        until_s = time.perf_counter() + self.left_s(time_s)
        while (left_s := until_s - time.perf_counter()) > 0.0:
            with contextlib.suppress(Exception):
                self.waiting()
            time.sleep(min(left_s, SLICE_S))
