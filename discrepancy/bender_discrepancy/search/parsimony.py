"""Flexible hypotheses against simple ones that leave hardly more.

Forms of the catalogue are not nature's to the last percent of the gap, and some are far more flexible than others. What
a flexible one gains on that last percent is no evidence for its name.
"""

import math
from collections.abc import Sequence

from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.search.evidence import EVIDENCE


def simplest_as_good(ranked: Sequence[Fitted], base: Fitted) -> Fitted:
    """Return the best hypothesis, or a far simpler one that is as good but for the last percent of the gap.

    A flexible form follows what the form of another effect leaves of it; that is no evidence for its name.
    """
    best = ranked[0]
    within = (EVIDENCE.form_within**2) * (total_square(base) - total_square(best))
    return next((x for x in ranked if is_overtaken(best, x, within)), best)


def is_overtaken(flexible: Fitted, simple: Fitted, within: float = math.inf) -> bool:
    """Return whether a far simpler hypothesis leaves hardly more than a flexible one."""
    fewer = flexible.hypothesis.free_count - simple.hypothesis.free_count
    return fewer >= EVIDENCE.fewer_numbers and total_square(simple) - total_square(flexible) <= within


def total_square(fitted: Fitted) -> float:
    """Return the sum of squares over all rows that fits and choices see."""
    return fitted.training_square + fitted.held_square
