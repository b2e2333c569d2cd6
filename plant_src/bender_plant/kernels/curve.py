"""A smooth curve through the origin with slope 1 there, between the ends that it was learned from.

Beyond them it runs on along the line from the origin through its end: the slope at the end of a power series is what
records tell least.
"""


def bent(r: float, c2: float, c3: float, c4: float, c5: float, low: float, high: float) -> float:
    """Return the reading of a displacement."""
    x = min(max(r, low), high)
    return r * (1.0 + x * (c2 + x * (c3 + x * (c4 + x * c5))))
