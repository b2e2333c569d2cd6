"""How records are read, and what a next experiment may ask for."""

from dataclasses import dataclass
from typing import Literal

Beginning = Literal["auto", "rest", "motion"]


@dataclass(frozen=True, slots=True)
class Settings:
    """How records are read, and what a next one may ask for.

    Attributes:
        linear: the command runs straight from row to row instead of being held.
        untimed: the times are only an order.
        highest_V: of the next experiment; None for no more than the records themselves reached.
        start: how the records begin: "rest", in "motion", or decided by the evidence ("auto").
        confidence: one minus the error rate of everything that is said of one diagnosis.
    """

    linear: bool = False
    untimed: bool = False
    highest_V: float | None = None
    start: Beginning = "auto"
    confidence: float = 0.99

    def __post_init__(self) -> None:
        if not 0.5 <= self.confidence < 1.0:
            raise ValueError(f"confidence must be from 0.5 to below 1, found {self.confidence!r}")
        if self.start not in ("auto", "rest", "motion"):
            raise ValueError(f"start must be auto, rest or motion, found {self.start!r}")
