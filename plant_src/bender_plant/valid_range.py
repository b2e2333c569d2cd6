"""Where a model that was learned from records is valid: beyond it, its curves and loops are extrapolations."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from bender_plant.parameter import ModelError

WITHIN = 1e-6
"""Of the range: rounding is no departure."""


@dataclass(frozen=True, slots=True)
class ValidRange:
    """What the records covered that a model was learned from.

    Attributes:
        lowest_V: command.
        highest_V: command.
        longest_s: record; slower memories than that were not seen. 0 where times were only an order.

    Raises:
        ModelError: a number is not finite, or the range is empty.
    """

    lowest_V: float
    highest_V: float
    longest_s: float

    def __post_init__(self) -> None:
        for name in ("lowest_V", "highest_V", "longest_s"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise ModelError(f"valid.{name}: found {value!r}, expected a finite number")
        if self.highest_V < self.lowest_V or self.longest_s < 0.0:
            raise ModelError(f"valid: found an empty range, {self}")

    def in_words(self, unit: str = "V") -> str:
        """Return the range as a part of a sentence."""
        over = f" over {self.longest_s:.4g} s" if self.longest_s else ""
        return f"{self.lowest_V:.4g} to {self.highest_V:.4g} {unit}{over}"

    def left_by(self, voltage_V: Sequence[float], unit: str = "V") -> str:
        """Return what is said of commands that leave the range; "" where none does."""
        low, high = float(min(voltage_V)), float(max(voltage_V))
        within = WITHIN * (self.highest_V - self.lowest_V)
        if low >= self.lowest_V - within and high <= self.highest_V + within:
            return ""
        return (
            f"the command runs from {low:.4g} to {high:.4g} {unit}, the model was learned from "
            f"{self.in_words(unit)}: outside of it the simulation is an extrapolation"
        )
