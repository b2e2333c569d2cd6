"""How records are read, and what a next experiment may ask for."""

import math
from dataclasses import dataclass

from bender_loop.errors import InputError

HIGHEST_V = 1000.0
"""The most that a next experiment may ask for: more is a slip of the unit."""


@dataclass(frozen=True, slots=True)
class Settings:
    """How records are read, and what a next one may ask for.

    Attributes:
        linear: the command runs straight from row to row instead of being held.
        untimed: the times are only an order.
        highest_V: of the next experiment.

    Raises:
        InputError: the highest voltage is out of its range.
    """

    linear: bool = False
    untimed: bool = False
    highest_V: float = 50.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.highest_V) and 0.0 < self.highest_V <= HIGHEST_V):
            raise InputError(f"highest_V: found {self.highest_V:g}, expected more than 0 and at most {HIGHEST_V:g} V")
