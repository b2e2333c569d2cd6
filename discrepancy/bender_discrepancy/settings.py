"""How records are read, and what a next experiment may ask for."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Settings:
    """How records are read, and what a next one may ask for.

    Attributes:
        linear: the command runs straight from row to row instead of being held.
        untimed: the times are only an order.
        highest_V: of the next experiment.
    """

    linear: bool = False
    untimed: bool = False
    highest_V: float = 50.0
