"""Units as FMI 2.0 wants them: SI base exponents and a factor for every unit string in use.

A unit string is a product of named units, with digits as exponents and one optional divisor: `V`, `kg/m3`,
`um/(V.s)`, `1/s`. `1` is the dimensionless unit.
"""

import re
from dataclasses import dataclass

BASES: tuple[str, ...] = ("kg", "m", "s", "A", "K", "rad")

_NAMED: dict[str, tuple[float, dict[str, int]]] = {
    "m": (1.0, {"m": 1}),
    "mm": (1e-3, {"m": 1}),
    "um": (1e-6, {"m": 1}),
    "nm": (1e-9, {"m": 1}),
    "s": (1.0, {"s": 1}),
    "ms": (1e-3, {"s": 1}),
    "kg": (1.0, {"kg": 1}),
    "A": (1.0, {"A": 1}),
    "K": (1.0, {"K": 1}),
    "rad": (1.0, {"rad": 1}),
    "deg": (0.017453292519943295, {"rad": 1}),
    "Hz": (1.0, {"s": -1}),
    "N": (1.0, {"kg": 1, "m": 1, "s": -2}),
    "Pa": (1.0, {"kg": 1, "m": -1, "s": -2}),
    "C": (1.0, {"A": 1, "s": 1}),
    "V": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -1}),
    "W": (1.0, {"kg": 1, "m": 2, "s": -3}),
    "J": (1.0, {"kg": 1, "m": 2, "s": -2}),
    "bar": (1e5, {"kg": 1, "m": -1, "s": -2}),
    "F": (1.0, {"kg": -1, "m": -2, "s": 4, "A": 2}),
    "Ohm": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
}
_DISPLAYED = {"m": "um"}


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit by its SI base exponents: value in SI = factor times value in this unit."""

    name: str
    factor: float
    exponents: dict[str, int]

    @property
    def display(self) -> tuple[str, float] | None:
        """Return the unit to show instead and its factor (shown = factor times value), None for the unit itself."""
        shown = _DISPLAYED.get(self.name)
        return None if shown is None else (shown, round(self.factor / _NAMED[shown][0], 9))


def parse_unit(name: str) -> Unit:
    """Return the unit that a string names.

    Raises:
        ValueError: part of the string is no unit known here.
    """
    over, _, under = name.partition("/")
    factor, exponents = 1.0, dict.fromkeys(BASES, 0)
    for text, sign in ((over, 1), (under, -1)):
        for part in filter(None, text.strip("()").split(".")):
            size, bases = _named(part, name)
            factor = factor * size if sign > 0 else factor / size
            for base, exponent in bases.items():
                exponents[base] += sign * exponent
    return Unit(name, factor, {base: exponent for base, exponent in exponents.items() if exponent})


def _named(part: str, whole: str) -> tuple[float, dict[str, int]]:
    match = re.fullmatch(r"([A-Za-z]+)(\d*)", part)
    if part == "1":
        return 1.0, {}
    if match is None or match[1] not in _NAMED:
        raise ValueError(f"unit {whole!r}: found {part!r}, expected one of {', '.join(_NAMED)}")
    power = int(match[2] or 1)
    factor, bases = _NAMED[match[1]]
    return factor**power, {base: power * exponent for base, exponent in bases.items()}
