"""A source with a buffer of its own, beside what the guard asks of every source."""

from collections.abc import Sequence
from typing import Protocol, TypeGuard

from bender_hil.supply.source import Source


class PlayingSource(Source, Protocol):
    """A source that plays levels by its own clock. `set_voltage` ends what it plays."""

    def play(self, levels_V: Sequence[float], rate_Hz: float) -> float:
        """Take the levels and begin; returns `time.perf_counter` of the first one. SupplyError.

        Raises:
            ValueError: the instrument has no buffer.
        """
        ...


def can_play(source: Source) -> TypeGuard[PlayingSource]:
    """Whether a source has a buffer."""
    return bool(getattr(source, "has_buffer", False))
