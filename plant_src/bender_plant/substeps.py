"""How a communication step is cut: short after a jump of the command, longer as the transients die away.

A transient of time constant tau that began s seconds ago has the curvature exp(-s / tau) / tau^2. Sub-steps that grow
in proportion to s keep the error of a parabola bounded for every tau at once, without knowing any of them.
"""

from functools import lru_cache

GROWTH = 0.06
ALMOST = 1.0 + 1e-9


@lru_cache(maxsize=1024)
def lengths_s(since_jump_s: float, step_s: float, first_s: float, longest_s: float, growth: float) -> list[float]:
    """Return the lengths of the sub-steps that fill `step_s`; the list is kept, and only to be read.

    Args:
        since_jump_s: time since the command last jumped.
        step_s: the communication step to fill.
        first_s: longest sub-step right after a jump.
        longest_s: longest sub-step at any time.
        growth: of the sub-steps with the time since the jump.
    """
    if step_s <= first_s and step_s <= longest_s:
        return [step_s]
    lengths: list[float] = []
    remaining = step_s
    elapsed = since_jump_s
    while True:
        limit = min(longest_s, max(first_s, growth * elapsed))
        if remaining <= limit * ALMOST:
            lengths.append(remaining)
            return lengths
        length = limit if remaining >= 2.0 * limit else 0.5 * remaining
        lengths.append(length)
        remaining -= length
        elapsed += length
