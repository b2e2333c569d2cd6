"""A smooth curve through the origin with slope 1 there."""


def bent(r: float, c2: float, c3: float, c4: float, c5: float) -> float:
    """Return the reading of a displacement."""
    return r * (1.0 + r * (c2 + r * (c3 + r * (c4 + r * c5))))
