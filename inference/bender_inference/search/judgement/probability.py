"""The probability that an effect is there: a logistic curve of the case against it.

The weights were fitted (maximum likelihood) to 998 effects that were told of 1 000 devices drawn at random and of 77
hidden benches, 11 of them outside the catalogue. `bender benchmark probabilities` prints how well they are kept on the
results of others, and what weights these would teach.
"""

import math
from dataclasses import dataclass

WEIGHTS = (-1.055, 2.822, 0.0, 0.346, 2.293)
"""Of one, of having passed, of the deviations, of the logarithm of the ratio and of the closed share.

Deviations tell nothing beyond what the others do: nearly all effects that are found have the most that counts.
"""
MOST_DEVIATIONS, MOST_LOG_RATIO = 8.0, 4.0
LEAST_LEFT = 1e-2
"""Smallest residual with an effect, as a part of that without it: a smaller one is no further evidence."""


@dataclass(frozen=True, slots=True)
class Case:
    """The case against an effect.

    Attributes:
        deviations: by which the best hypothesis predicts unseen blocks better than everything without the effect.
        log_ratio: of the mean squares above the noise that the best of those and the best hypothesis leave.
        closed: part of the gap's variance above the noise floor that the best hypothesis closes.
        passed: the effect passed every test of a certain one.
    """

    deviations: float
    log_ratio: float
    closed: float
    passed: bool = False

    @classmethod
    def of(cls, deviations: float, rest_um2: float, left_um2: float, closed: float) -> "Case":
        """Return the case, each part within what it can tell.

        Args:
            deviations: see above.
            rest_um2: mean square above the noise floor that the best hypothesis without the effect leaves.
            left_um2: the same of the best one.
            closed: see above.
        """
        ratio = math.log(max(rest_um2, 1e-300) / max(left_um2, LEAST_LEFT * rest_um2, 1e-300))
        return cls(
            min(max(deviations, 0.0), MOST_DEVIATIONS),
            min(max(ratio, 0.0), MOST_LOG_RATIO),
            min(max(closed, 0.0), 1.0),
        )

    def seen_by_none(self, closed: float) -> "Case":
        """Return the case where reported rows close another part of the gap.

        What is left without an effect is no more than the gap, so neither is the ratio more than the gap's. Then
        nothing has passed.
        """
        share = min(max(closed, 0.0), self.closed)
        ratio = min(self.log_ratio, -math.log1p(-min(share, 1.0 - LEAST_LEFT)))
        return Case(self.deviations, ratio, share)

    @property
    def parts(self) -> tuple[float, float, float, float, float]:
        """What the weights belong to."""
        return 1.0, float(self.passed), self.deviations, self.log_ratio, self.closed


def probability(case: Case) -> float:
    """Return the probability of an effect."""
    return 1.0 / (1.0 + math.exp(-sum(w * x for w, x in zip(WEIGHTS, case.parts, strict=True))))
