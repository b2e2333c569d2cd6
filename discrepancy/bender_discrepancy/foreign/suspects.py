"""Parameters of an FMU that may be off: which, and how far they may go."""

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bender_loop.errors import InputError

TUNABLE = "tunable"
WITHIN = 2.0
"""Without a range that is told or declared, a parameter may be this many times as large or as small."""


@dataclass(frozen=True, slots=True)
class Suspect:
    """A parameter that may be off.

    Attributes:
        name: in the FMU.
        given: its value as the model is given.
        low: least value that it may have.
        high: most.
        unit: as declared, "1" for none.
    """

    name: str
    given: float
    low: float
    high: float
    unit: str

    @property
    def log(self) -> bool:
        """Whether it is searched by its logarithm: its range is of one sign."""
        return self.low > 0.0

    def inward(self, value: float) -> float:
        """Return the coordinate of a value, from 0 at the least to 1 at the most."""
        if self.log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def outward(self, coordinate: float) -> float:
        """Return the value at a coordinate."""
        if self.log:
            value = self.low * math.exp(coordinate * math.log(self.high / self.low))
        else:
            value = self.low + coordinate * (self.high - self.low)
        return min(max(value, self.low), self.high)


def add_suspect_argument(parser: argparse.ArgumentParser) -> None:
    """Declare `--suspect`."""
    parser.add_argument(
        "--suspect",
        action="append",
        default=[],
        metavar="NAME[=LOW:HIGH]",
        help="a parameter of the FMU that may be off, and how far it may go (default: what the FMU declares, else half "
        "to double); may be given several times; `tunable` for all that the FMU declares tunable",
    )


def suspects_of(fmu: Path, words: Sequence[str], start_values: Mapping[str, float]) -> tuple[Suspect, ...]:
    """Return the suspected parameters of an FMU.

    Args:
        fmu: its file.
        words: `NAME`, `NAME=LOW:HIGH` or `tunable`.
        start_values: that were set by other means, by name.

    Raises:
        InputError: a word is none of these, names no real parameter, names one twice, or its range is empty, leaves out
            the value as given, or is not known.
    """
    from bender_loop.fmu.file import read_description
    from bender_loop.fmu.ports import REALS, parameter_settings

    description = read_description(fmu)
    known = {x.name: x for x in description.modelVariables if x.causality == "parameter" and x.type in REALS}
    found: dict[str, Suspect] = {}
    for word in words:
        if word == TUNABLE:
            tunable = [name for name, x in known.items() if x.variability == TUNABLE and not x.dimensions]
            if not tunable:
                raise InputError(f"{fmu}: --suspect tunable: found no tunable parameter, expected names of parameters")
            ranged = [x for x in tunable if start_values.get(x, float(known[x].start or 0.0)) != 0.0]
            found = {name: _suspect(fmu, known[name], None, start_values) for name in ranged} | found
            continue
        name, _, text = word.partition("=")
        parameter_settings(fmu, description, {name: start_values.get(name, 0.0)} if name not in known else {})
        if name not in known:
            raise InputError(f"--suspect: found {name!r}, expected a real parameter of {fmu}")
        if name in found and not (TUNABLE in words and words.count(word) == 1):
            raise InputError(f"--suspect: found {name} twice, expected each parameter once")
        found[name] = _suspect(fmu, known[name], _range(word, text) if text else None, start_values)
    return tuple(found.values())


def _range(word: str, text: str) -> tuple[float, float]:
    try:
        low, high = (float(x) for x in text.split(":"))
    except ValueError:
        low = high = math.nan
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"--suspect: found {word!r}, expected NAME=LOW:HIGH with finite numbers, LOW below HIGH")
    return low, high


def _suspect(fmu: Path, variable: Any, told: tuple[float, float] | None, start: Mapping[str, float]) -> Suspect:
    name = variable.name
    given = float(start.get(name, variable.start if variable.start is not None else math.nan))
    if not math.isfinite(given):
        raise InputError(f"{fmu}: {name}: found no start value, expected one; give it by --set {name}=VALUE")
    least, most = (math.nan if x is None else float(x) for x in (variable.min, variable.max))
    low, high = told or (
        min(given / WITHIN, given * WITHIN) if math.isnan(least) else least,
        max(given / WITHIN, given * WITHIN) if math.isnan(most) else most,
    )
    if told is None and math.isfinite(given) and given != 0.0:
        # a declared bound may be far off all that makes sense: a parameter that is off is so by a factor
        low, high = max(low, min(given / WITHIN, given * WITHIN)), min(high, max(given / WITHIN, given * WITHIN))
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"--suspect {name}: found no range for it at {given:g}, expected --suspect {name}=LOW:HIGH")
    if not low <= given <= high:
        raise InputError(
            f"--suspect {name}: found {low:g} to {high:g}, expected a range that holds {given:g}, as given"
        )
    if low < least or high > most:
        raise InputError(f"--suspect {name}: found {low:g} to {high:g}, expected {least:g} to {most:g}, as declared")
    unit = variable.unit or (variable.declaredType.unit if variable.declaredType else None)
    return Suspect(name, given, low, high, unit or "1")
