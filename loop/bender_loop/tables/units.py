"""Units that people write and the internal ones: V, um, s, A, degC."""

import difflib
from collections.abc import Iterable

# (multiplier, divisor) instead of one factor: dividing by 1000 rounds once, so 35 ms is the double 0.035.
Scale = tuple[float, float]

VOLTAGE_V: dict[str, Scale] = {"V": (1.0, 1.0), "mV": (1.0, 1e3), "kV": (1e3, 1.0), "uV": (1.0, 1e6)}
LENGTH_UM: dict[str, Scale] = {
    "um": (1.0, 1.0),
    "nm": (1.0, 1e3),
    "mm": (1e3, 1.0),
    "cm": (1e4, 1.0),
    "m": (1e6, 1.0),
    "inch": (25400.0, 1.0),
    "mil": (25.4, 1.0),
}
TIME_S: dict[str, Scale] = {
    "s": (1.0, 1.0),
    "ms": (1.0, 1e3),
    "us": (1.0, 1e6),
    "ns": (1.0, 1e9),
    "min": (60.0, 1.0),
    "h": (3600.0, 1.0),
}
CURRENT_A: dict[str, Scale] = {"A": (1.0, 1.0), "mA": (1.0, 1e3), "uA": (1.0, 1e6), "nA": (1.0, 1e9)}
TEMPERATURE_C: dict[str, Scale] = {"degC": (1.0, 1.0), "C": (1.0, 1.0), "°C": (1.0, 1.0)}

MOST_NAMED = 8
"""Of names that a message tells."""


def find(table: dict[str, Scale], unit: str) -> Scale | None:
    """The scale of `unit` in `table`, None where it is not there; both micro signs stand for u."""
    return table.get(unit.strip().replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u"))


def near(name: str, names: Iterable[str]) -> str:
    """Names like `name` as a part of a message, all of them where they are few, else the nearest."""
    known = list(dict.fromkeys(names))
    if not known:
        return "there are none"
    if len(known) <= MOST_NAMED:
        return "there are " + ", ".join(known) if len(known) > 1 else f"there is {known[0]}"
    folded = {entry.casefold(): entry for entry in known}
    like = difflib.get_close_matches(name.casefold(), list(folded), n=MOST_NAMED, cutoff=0.5)
    shown = [folded[entry] for entry in like] or known[:MOST_NAMED]
    return f"{len(known)} others, " + ("nearest " if like else "such as ") + ", ".join(shown)
