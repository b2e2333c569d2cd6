"""Parameters that carry their unit, bounds and meaning, declared once and read by everything else.

A parameter is a dataclass field whose name ends with its unit (`thickness_m`, `time_constant_s`); a dimensionless one
has no ending. The same metadata makes the checks, the model file, the FMI variables and the documentation.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cache
from types import MappingProxyType
from typing import Any

_SUFFIX = {"1": ""}
_SHOWN = 100
_LARGEST = 1.7976931348623157e308
WIDEST = 1e30
"""Of a number that no unit bounds: FMI tools want an end, and squares of it are still numbers."""


class ModelError(ValueError):
    """A model that cannot be: the message names the key, the value found and what was expected."""


@dataclass(frozen=True, slots=True)
class Meaning:
    """What is known of a parameter beside its value: unit, the bounds that are enforced, and words."""

    unit: str
    low: float
    high: float
    text: str
    tunable: bool


def parameter(
    default: Any,
    *,
    unit: str,
    low: float = -WIDEST,
    high: float = WIDEST,
    text: str,
    tunable: bool = False,
) -> Any:
    """Return a dataclass field with its meaning; `tunable` ones may change while the plant runs."""
    return field(default=default, metadata={"meaning": Meaning(unit, low, high, text, tunable)})


def meanings(settings: Any) -> Mapping[str, Meaning]:
    """Return the meaning of each parameter of a dataclass (or of its type), by field name, in order."""
    return _meanings(settings if isinstance(settings, type) else type(settings))


@cache
def _meanings(kind: Any) -> Mapping[str, Meaning]:
    return MappingProxyType({f.name: f.metadata["meaning"] for f in fields(kind) if "meaning" in f.metadata})


def unit_suffix(unit: str) -> str:
    """Return the ending that a name with this unit bears: `um/(V.s)` gives `_um_per_V_s`, `1` gives nothing."""
    if unit not in _SUFFIX:
        _SUFFIX[unit] = "_" + unit.replace("/", "_per_").replace("(", "").replace(")", "").replace(".", "_")
    return _SUFFIX[unit]


def spoken_name(field_name: str, unit: str) -> str:
    """Return the name without its unit, as FMI variables bear it (the unit stands in an attribute of its own)."""
    return field_name.removesuffix(unit_suffix(unit))


def check(settings: Any, where: str) -> None:
    """Check every parameter of a dataclass against its bounds.

    Raises:
        ModelError: a value is no number, not finite or out of bounds; says which, where and what is allowed.
    """
    for name, meaning in meanings(settings).items():
        value = getattr(settings, name)
        values = value if isinstance(value, tuple) else (value,)
        for number in values:
            _check_number(number, meaning, f"{where}.{name}")


def curve_end(default: float, which: str, unit: str = "V") -> Any:
    """Declare the lowest or the highest voltage that a curve was learned from; beyond it the curve runs straight.

    A curve of the displacement has its ends in um.
    """
    of = "voltage" if unit == "V" else "displacement"
    return parameter(default, unit=unit, low=-1e12, high=1e12, text=f"{which} {of} that the curve was learned from")


def check_straight(where: str, below: float, above: float, unit: str = "V") -> None:
    """Check the ends beyond which a curve runs straight.

    Raises:
        ModelError: the lower one is not below the upper one.
    """
    if below >= above:
        raise ModelError(
            f"{where}.straight_below_{unit}: found {below!r} beside straight_above_{unit} = {above!r}, expected less"
        )


def check_given(number: Any, unit: str, low: float, high: float, where: str) -> None:
    """Check a number that may be left out (None), as what is calculated otherwise.

    Raises:
        ModelError: it is no number, not finite or out of bounds.
    """
    if number is not None:
        _check_number(number, Meaning(unit, low, high, "", False), where)


def _check_number(number: Any, meaning: Meaning, where: str) -> None:
    if isinstance(number, bool) or not isinstance(number, int | float) or not _is_finite(number):
        found = repr(number) if isinstance(number, float) or len(str(number)[:_SHOWN]) < _SHOWN else "a huge number"
        raise ModelError(f"{where}: found {found}, expected a finite number")
    if not meaning.low <= number <= meaning.high:
        unit = "" if meaning.unit == "1" else f" {meaning.unit}"
        raise ModelError(f"{where}: found {number!r}, expected {meaning.low:g} to {meaning.high:g}{unit}")


def _is_finite(number: float) -> bool:
    """Return whether a number is one; a whole number beyond every float is none, and NaN compares with nothing."""
    return -_LARGEST <= number <= _LARGEST
