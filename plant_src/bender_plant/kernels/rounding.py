"""Rounding to the steps of a converter."""


def rounded(value: float, q: float) -> float:
    """Return the multiple of q next to the value; q = 0 leaves it alone."""
    return q * round(value / q) if q > 0.0 else value
