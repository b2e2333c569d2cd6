"""Quantities of other rigs: bar, rpm, mm/s, N m; their units as people and FMUs write them, through pint.

A record in volts and lengths is kept in V and um. Any other quantity is kept as it stands, in the unit of its column,
and an FMU's variable is brought to that unit.
"""

import re
from functools import cache
from typing import TYPE_CHECKING, Any

from bender_loop.errors import InputError

if TYPE_CHECKING:
    from pint import UnitRegistry

VOLT, MICROMETRE = "V", "um"
Quantities = tuple[str, str]
"""Units of what is commanded and of what is read."""
USUAL: Quantities = (VOLT, MICROMETRE)


@cache
def _registry() -> "UnitRegistry[Any]":
    from pint import UnitRegistry

    return UnitRegistry(cache_folder=None)


def is_known(unit: str) -> bool:
    """Return whether a unit is one that can be converted."""
    return _parsed(unit) is not None


def factor(given: str, wanted: str) -> float:
    """Return what a value in one unit is multiplied by to be in another one.

    Raises:
        InputError: a unit is not known, they are of different quantities, or one has another zero than the other.
    """
    if _plain(given) == _plain(wanted):
        return 1.0
    known = [_parsed(x) for x in (given, wanted)]
    for unit, found in zip((given, wanted), known, strict=True):
        if found is None:
            raise InputError(f"unit: found {unit!r}, expected one as mV, bar, rpm, mm/s or N m")
    from pint import DimensionalityError, OffsetUnitCalculusError

    try:
        zero, one = (_registry().Quantity(x, known[0]).to(known[1]).magnitude for x in (0.0, 1.0))
    except (DimensionalityError, OffsetUnitCalculusError):
        raise InputError(f"unit: found {given!r} where {wanted!r} is needed, another quantity") from None
    if zero != 0.0:
        raise InputError(f"unit: found {given!r} where {wanted!r} is needed; their zeros differ")
    return float(one)


def _parsed(unit: str) -> Any:
    text = _plain(unit)
    if not text:
        return None
    try:
        return _registry().Unit(text)
    except Exception:  # the parser raises whatever the text makes it trip over
        return None


def _plain(unit: str) -> str:
    """Return a unit as pint reads it: `N.m`, `N m` and `N·m` with a star, `m2` and `m²` with a power."""
    text = unit.strip().replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u").replace("^", "**")
    text = text.replace("²", "**2").replace("³", "**3").replace("·", "*")
    text = re.sub(r"(?<=[A-Za-z])\s*[. ]\s*(?=[A-Za-z])", "*", text)
    return re.sub(r"(?<=[A-Za-z])(-?\d)", r"**\1", text)
