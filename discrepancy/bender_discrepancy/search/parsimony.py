"""Flexible hypotheses against simple ones that leave hardly more.

Forms of the catalogue are not nature's to the last percent of the gap, and some are far more flexible than others. What
a flexible one gains on that last percent is no evidence for its name.
"""

import math
from collections.abc import Sequence

from bender_discrepancy.fitting.output_error import Fitted
from bender_discrepancy.search.evidence import EVIDENCE


def simplest_as_good(ranked: Sequence[Fitted], base: Fitted, *, nothing_left: bool) -> Fitted:
    """Return the best hypothesis, or a far simpler one that is as good but for what the form of an effect may leave.

    A flexible form follows what the form of another effect leaves of it; that is no evidence for its name. Where the
    best leaves noise alone, the last percent of the gap decides. Where structure is left in any case, the simpler one
    may leave as much of the gap as its form may be off: the next effect is sought in that, and a flexible form that
    has taken it up would hide it.

    Args:
        ranked: hypotheses, best first.
        base: the model as given.
        nothing_left: whether the best leaves noise alone.
    """
    best = ranked[0]
    share = EVIDENCE.form_within**2 if nothing_left else EVIDENCE.inadequacy
    within = share * (total_square(base) - total_square(best))
    return next((x for x in ranked if is_overtaken(best, x, within)), best)


def is_overtaken(flexible: Fitted, simple: Fitted, within: float = math.inf) -> bool:
    """Return whether a far simpler hypothesis leaves hardly more than a flexible one."""
    fewer = flexible.hypothesis.free_count - simple.hypothesis.free_count
    return fewer >= EVIDENCE.fewer_numbers and total_square(simple) - total_square(flexible) <= within


def is_plainer(rival: Fitted, best: Fitted, base: Fitted) -> bool:
    """Return whether a rival has fewer numbers than the best, and leaves more by no more than the last percent."""
    fewer = rival.hypothesis.free_count < best.hypothesis.free_count
    within = EVIDENCE.form_within**2 * (total_square(base) - total_square(best))
    return fewer and total_square(rival) - total_square(best) <= within


def total_square(fitted: Fitted) -> float:
    """Return the sum of squares over all rows that fits and choices see."""
    return fitted.training_square + fitted.held_square
