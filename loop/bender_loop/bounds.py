"""Checks that settings share: a bad value is refused with its name, what was found and what was expected."""

import math
from collections.abc import Mapping

Bounds = tuple[float, float]
"""Smallest and largest allowed value."""

ABOVE_0: Bounds = (5e-324, math.inf)
FROM_0: Bounds = (0.0, math.inf)
ANY: Bounds = (-math.inf, math.inf)


def check_numbers(settings: object, bounds: Mapping[str, Bounds], *, whole: tuple[str, ...] = ()) -> None:
    """Refuse attributes that are no finite numbers or lie outside their bounds; None passes.

    Args:
        settings: whose attributes are checked.
        bounds: by attribute.
        whole: attributes that must be whole numbers.

    Raises:
        ValueError: names the attribute, what was found and what was expected.
    """
    for name, (lowest, highest) in bounds.items():
        value = getattr(settings, name)
        if value is None:
            continue
        kind = int if name in whole else int | float
        is_number = isinstance(value, kind) and not isinstance(value, bool)
        # a whole number is finite, and may be too large to be asked
        if not is_number or (isinstance(value, float) and not math.isfinite(value)):
            raise ValueError(f"{name}: found {value!r:.40}, expected a {'whole' if name in whole else 'finite'} number")
        if not lowest <= value <= highest:
            raise ValueError(f"{name}: found {value!r:.40}, expected {_in_words(lowest, highest)}")


def _in_words(lowest: float, highest: float) -> str:
    least = "more than 0" if lowest == ABOVE_0[0] else f"at least {lowest:g}"
    if math.isinf(highest):
        return least
    if math.isinf(lowest):
        return f"at most {highest:g}"
    return f"{least} and at most {highest:g}"
