"""How records are read, and what a next experiment may ask for."""

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

from bender_loop.errors import InputError
from bender_loop.records.drive import InputHold

Beginning = Literal["auto", "rest", "motion"]

HIGHEST_V = 1000.0
"""The most that a next experiment may ask for: more is a slip of the unit."""
LEAST_CONFIDENCE = 0.5
RELEVANT = 0.005
"""Of the stroke."""


@dataclass(frozen=True, slots=True)
class Settings:
    """How records are read, and what a next one may ask for.

    Attributes:
        linear: the command runs straight from row to row instead of being held.
        untimed: the times are only an order.
        highest_V: of the next experiment; None for no more than the records themselves reached.
        start: how the records begin: "rest", in "motion", or decided by the evidence ("auto").
        confidence: one minus the error rate of everything that is said of one diagnosis.
        smooth: the command is band-limited between the rows.
        decide_hold: nobody said what the command does between the rows: it is held, unless the records fit another
            course far better.
        with_record_effects: the corrected model also has what belongs to the records: drift, ageing, hum.
        slew_V_per_s: fastest change that the next experiment may ask for, from row to row; inf for any.
        relevant: share of the stroke; a residual that is smaller makes no verdict by itself.
        same_zero: the sensor was not zeroed between the records: one offset holds for all of them.

    Raises:
        InputError: a setting is out of its range.
    """

    linear: bool = False
    untimed: bool = False
    highest_V: float | None = None
    start: Beginning = "auto"
    confidence: float = 0.99
    smooth: bool = False
    decide_hold: bool = False
    with_record_effects: bool = False
    slew_V_per_s: float = math.inf
    relevant: float = RELEVANT
    same_zero: bool = False

    @property
    def input_hold(self) -> InputHold:
        """How the command runs from row to row."""
        return "smooth" if self.smooth else "linear" if self.linear else "hold"

    def between_rows(self, hold: str) -> "Settings":
        """Return the settings with what the command does between the rows; "auto" where the records decide."""
        return replace(self, linear=hold in ("linear", "smooth"), smooth=hold == "smooth", decide_hold=hold == "auto")

    def __post_init__(self) -> None:
        high = self.highest_V
        if high is not None and not (math.isfinite(high) and 0.0 < high <= HIGHEST_V):
            raise InputError(f"highest_V: found {high:g}, expected more than 0 and at most {HIGHEST_V:g} V")
        if not 0.0 <= self.relevant < 1.0:
            raise InputError(f"relevant: found {self.relevant:g}, expected a share from 0 to below 1")
        if not self.slew_V_per_s > 0.0:
            raise InputError(f"slew_V_per_s: found {self.slew_V_per_s:g}, expected more than 0")
        if not LEAST_CONFIDENCE <= self.confidence < 1.0:
            raise InputError(f"confidence: found {self.confidence:g}, expected from {LEAST_CONFIDENCE:g} to below 1")
        if self.start not in get_args(Beginning):
            raise InputError(f"start: found {self.start!r}, expected one of {', '.join(get_args(Beginning))}")
