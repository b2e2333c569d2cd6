"""A number as it is told: value, unit, standard deviation, and what is typical."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Number:
    """One number of a block.

    Attributes:
        name: as in the model file, `gains[1]` for the first of a list.
        value: in its unit.
        unit: "1" where it has none.
        std: standard deviation; 0 where the form fixes it, inf where the records cannot tell.
        typical: usual sizes on a bench like this one, None where none are known.
        why: where that comes from.
        unusual: outside of what is typical by more than chance.
        interval: that holds the true value with 95 %; None where the form fixes it or the records cannot tell.
        profiled: the interval was sought by profile likelihood, since the misfit is no parabola.
    """

    name: str
    value: float
    unit: str
    std: float = 0.0
    typical: tuple[float, float] | None = None
    why: str = ""
    unusual: bool = False
    interval: tuple[float, float] | None = None
    profiled: bool = False

    @property
    def field(self) -> str:
        """The parameter it belongs to: its name without its place in a list."""
        return self.name.partition("[")[0]

    @property
    def is_open(self) -> bool:
        """Whether the records leave its sign open, or do not tell it at all."""
        return math.isinf(self.std) or self.std > abs(self.value) > 0.0
