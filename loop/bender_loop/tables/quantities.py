"""Quantities of other rigs: bar, rpm, mm/s, N m; their units as people and FMUs write them, through pint.

A record in volts and lengths is kept in V and um. Any other quantity is kept as it stands, in the unit of its column,
and an FMU's variable is brought to that unit.
"""

import math
import re
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from bender_loop.errors import InputError
from bender_loop.tables.units import LENGTH_UM, VOLTAGE_V, find

if TYPE_CHECKING:
    from pint import UnitRegistry

VOLT, MICROMETRE = "V", "um"


class Quantities(NamedTuple):
    """Units of what is commanded and of what is read.

    Attributes:
        command: in which commands are kept.
        reading: in which readings are kept.
        stated: units of both as the record came: those of an FMU's variables that declare none. Empty: not known.
    """

    command: str
    reading: str
    stated: tuple[str, str] = ("", "")


USUAL = Quantities(VOLT, MICROMETRE)
MOST_POWER = 15
"""Of ten, by which a unit may take another prefix."""
LEAST_SIZE, MOST_SIZE = 0.01, 1e5
"""Between these the largest number of a column is of ordinary size, and its unit stays as people stated it."""


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


def shown(unit: str | None, kept: str, usual: str) -> str:
    """Return the unit in which a variable's numbers are: that of a record, else V or um, else as it is declared.

    Args:
        unit: as the FMU declares it.
        kept: in which it is kept by `Quantities`.
        usual: V or um.
    """
    if kept != usual or not unit:
        return kept
    try:
        factor(unit, usual)
    except InputError:
        return unit
    return usual


def of_input_and_output(text: str) -> Quantities:
    """Return quantities of the units in which variables without a unit of their own are: `V,um`, `W,K`.

    Raises:
        InputError: there are not two, or one is not known.
    """
    given = [x.strip() for x in text.split(",")]
    tables = VOLTAGE_V, LENGTH_UM
    if len(given) != len(tables):
        raise InputError(f"--units: found {text!r}, expected the units of input and output, as V,um")
    kept = []
    for unit, table, usual in zip(given, tables, (VOLT, MICROMETRE), strict=True):
        if find(table, unit) is None and not is_known(unit):
            raise InputError(
                f"--units: found {unit!r}, expected one of {', '.join(table)}, or another one as W, K, bar"
            )
        kept.append(unit if find(table, unit) is None else usual)
    return Quantities(kept[0], kept[1], stated=(given[0], given[1]))


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


_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "u", -3: "m", 3: "k", 6: "M", 9: "G", 12: "T", 15: "P"}


def compact(unit: str, span: float) -> tuple[float, str]:
    """Return the factor and the unit in which a column is kept: that stated, where its numbers are of ordinary size.

    Others come to a number from 1 to 1000, as 2e-6 bar to 2 ubar: numerical floors and neutral values of blocks are
    made for numbers of ordinary size. A unit that takes no prefix, or with a zero of its own, stays.

    Args:
        unit: as it is stated.
        span: the largest magnitude in the column.
    """
    if not math.isfinite(span) or span <= 0.0 or LEAST_SIZE <= span <= MOST_SIZE:
        return 1.0, unit
    found = _parsed(unit)
    if found is None or found.dimensionless:
        return 1.0, unit
    power = 3 * math.floor(math.log10(span) / 3.0 + 1e-9)
    if power == 0 or abs(power) > MOST_POWER:
        return 1.0, unit
    try:
        near = _registry().Quantity(10.0**power, found).to_compact()
        label = f"{near.units:~}".replace(" ", "").replace("µ", "u")
        # as people wrote it, where it had no prefix: "uN m", not "m*uN"
        written = f"{_PREFIXES.get(power, '')}{unit.strip()}"
        label = written if _parsed(written) == near.units else label
        times = factor(unit, label)
    except Exception:  # units with a zero of their own, and logarithmic ones
        return 1.0, unit
    return (times, label) if abs(math.log10(times) + power) < 1e-6 else (1.0, unit)
