"""What an investigation is asked to do."""

import math
from dataclasses import dataclass

LONGEST_S = 86_400.0


@dataclass(frozen=True, slots=True)
class InvestigationSettings:
    """One investigation.

    Attributes:
        budget_s: time on the bench, all plays together.
        excitation_s: length of the first excitation, at most.
        experiments: at most so many further plays before a verdict.
        pairs: old and new gains are played so many times each.
        step_s: how long each of the two set-points of a play is held.
        confidence: of the interval that says whether the new gains are better.
        least_gain: a difference below this part of the old cost does not count as one.
        evaluations: of the tuning.
        seed: of excitations and tuning.

    Raises:
        ValueError: a value is out of its range.
    """

    budget_s: float = 600.0
    excitation_s: float = 110.0
    experiments: int = 3
    pairs: int = 5
    step_s: float = 3.0
    confidence: float = 0.95
    least_gain: float = 0.02
    evaluations: int = 151
    seed: int = 1

    def __post_init__(self) -> None:
        for name, low, high in (
            ("budget_s", 10.0, LONGEST_S),
            ("excitation_s", 2.0, LONGEST_S),
            ("step_s", 0.2, 1000.0),
            ("confidence", 0.5, 0.9999),
            ("least_gain", 0.0, 1.0),
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and low <= value <= high):
                raise ValueError(f"{name} must be {low:g} to {high:g}, found {value!r}")
        for name, low, high in (("experiments", 0, 20), ("pairs", 2, 100), ("evaluations", 20, 10_000)):
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} must be {low} to {high}, found {getattr(self, name)!r}")
