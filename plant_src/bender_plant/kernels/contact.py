"""What a contact passes on of the way beyond it, at once or gradually."""

import math


def contact(x: float, s: float) -> float:
    """Return max(x, 0), or s ln(1 + exp(x / s)) where the contact takes over gradually over s."""
    if s == 0.0:
        return max(x, 0.0)
    return max(x, 0.0) + s * math.log1p(math.exp(-abs(x) / s))
