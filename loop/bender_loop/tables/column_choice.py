"""Which columns of a table are meant: by name, by position, or by what such columns are usually called."""

import re
from collections.abc import Collection, Mapping, Sequence

from bender_loop.errors import InputError
from bender_loop.tables.quantities import factor, is_known
from bender_loop.tables.text_layout import unit_at_end, unit_in_heading
from bender_loop.tables.units import LENGTH_UM, TIME_S, VOLTAGE_V, Scale, find

USUAL_NAMES: Mapping[str, tuple[str, ...]] = {
    "time": ("time", "t", "zeit", "temps", "tiempo", "seconds", "timestamp"),
    "voltage": ("voltage", "u", "v", "volt", "volts", "spannung", "tension", "command", "input", "uin", "vin"),
    "displacement": (
        "displacement", "d", "y", "x", "weg", "auslenkung", "position", "pos", "deflection", "deplacement",
        "verschiebung", "output", "tip",
    ),
}  # fmt: skip
"""What the three columns of a record are called elsewhere, in small letters, without units."""
_INPUT_WORDS = {
    "drive", "input", "command", "cmd", "pwm", "duty", "current", "strom", "control", "actuator", "excitation", "u",
    "uin", "vin", "voltage", "volt", "volts", "spannung", "tension", "heater", "valve", "pump",
}  # fmt: skip
_INPUT_UNITS = ("%", "percent", "pct", "A", "mA", "W", "kW")
POSITIONAL = ("time", "voltage", "displacement")
_UNITS: Mapping[str, dict[str, Scale]] = {"time": TIME_S, "voltage": VOLTAGE_V, "displacement": LENGTH_UM}
_UNIT_AT_END = re.compile(r"[\[(].*?[\])]|(?<=\S)\s*/\s*\S+$")
_BRACKETS, _MARKS = re.compile(r"[\[(].*?[\])]"), re.compile(r"[^a-z0-9]+")
_UNIT_ENDINGS = ("s", "ms", "us", "v", "mv", "um", "nm", "mm")


def plain_name(name: str) -> str:
    """Return a column's name in small letters, without brackets, marks and a unit at its end (`t / ms`, `t_ms`)."""
    folded = name.casefold().replace("é", "e").replace("µ", "u").replace("μ", "u")
    words = _MARKS.sub(" ", _UNIT_AT_END.sub(" ", folded)).split()
    if len(words) > 1 and (words[-1] in _UNIT_ENDINGS or unit_at_end(name)):
        words = words[:-1]
    return " ".join(words)


def found_columns(
    header: Sequence[str], units: Sequence[str], known: Collection[str], told: Collection[str]
) -> dict[str, str]:
    """Return the columns of time, voltage and displacement that are not known yet, none where two could be.

    Beside a time and the input, the only other column is the reading. Of the only two beside a time, the one that an
    input's name or unit marks is the input.

    Args:
        header: names of the columns that are nothing else.
        units: of these columns, where they do not stand in the names.
        known: keys of the columns that are not sought.
        told: those of them that the user names.
    """
    found = {key: name for key, name in usual_columns(header, units).items() if key not in known}
    left = [name for name in header if name not in found.values()]
    lacking = [key for key in POSITIONAL if key not in known and key not in found]
    if lacking == ["voltage", "displacement"] and len(left) == 2:
        command = _input_of(left, units and [units[header.index(x)] for x in left])
        if command is not None:
            found |= {"voltage": command, "displacement": next(x for x in left if x != command)}
    elif len(left) == 1 and lacking == ["displacement"]:
        found["displacement"] = left[0]
    elif len(left) == 1 and lacking == ["voltage"]:
        command = _input_of(left, units and [units[header.index(left[0])]])
        found |= {"voltage": left[0]} if command is not None or "displacement" in told else {}
    return found


def _input_of(names: Sequence[str], units: Sequence[str]) -> str | None:
    """Return the only one of some columns that its name, or else its unit, marks as an input."""
    named = [x for x in names if not _INPUT_WORDS.isdisjoint(plain_name(x).split())]
    stated = zip(names, units or map(unit_in_heading, names), strict=True)
    driven = [x for x, unit in stated if unit in _INPUT_UNITS or find(VOLTAGE_V, unit) is not None]
    return next((x[0] for x in (named, driven) if len(x) == 1), None)


def usual_columns(header: Sequence[str], units: Sequence[str] = ()) -> dict[str, str]:
    """Return the columns that say what they are, by their names or else by their units; none where two could be.

    Args:
        header: names of the columns.
        units: of the columns, where they do not stand in the names.
    """
    found: dict[str, str] = {}
    stated = dict(zip(header, units or map(unit_in_heading, header), strict=True))
    for key, usual in USUAL_NAMES.items():
        matches = [name for name in header if plain_name(name) in usual]
        if key == "time":
            matches = [name for name in matches if not _is_of_no_time(stated[name])]
            if all(plain_name(name) == "t" for name in matches):  # T beside t is a temperature
                matches = [name for name in matches if name == "t"] or matches
        if len(matches) == 1:
            found[key] = matches[0]
    for key, scales in _UNITS.items():
        matches = [name for name, unit in stated.items() if find(scales, unit) is not None]
        if key not in found and len(matches) == 1 and matches[0] not in found.values():
            found[key] = matches[0]
    return found


def _is_of_no_time(unit: str) -> bool:
    """Return whether a unit is known and of another quantity than time."""
    if find(TIME_S, unit) is not None or not is_known(unit):
        return False
    try:
        factor(unit, "s")
    except InputError:
        return True
    return False


def positional(text: str, keys: Sequence[str]) -> dict[str, str] | None:
    """Return `t,U,d` as names of time, voltage and displacement; None where it is in the form `time=t`.

    Raises:
        InputError: there are not three.
    """
    if "=" in text:
        return None
    names = [x.strip() for x in text.split(",")]
    if len(names) != len(POSITIONAL) or not all(names):
        raise InputError(
            f"--columns: found {text!r}, expected entries like time=t with a comma between, or three names in the "
            f"order {', '.join(POSITIONAL)}; the keys are {', '.join(keys)}"
        )
    return dict(zip(POSITIONAL, names, strict=True))


def by_number(name: str, header: Sequence[str]) -> str:
    """Return the column of a number from 1 where no column bears that number as its name."""
    if name in header or not name.isdigit() or not 1 <= int(name) <= len(header):
        return name
    return header[int(name) - 1]


def with_heading(name: str, header: Sequence[str]) -> str:
    """Return the column of a name, of which the heading may say the unit as well: `force` for `force [N]`."""
    found = [x for x in header if _BRACKETS.sub("", x).strip() == name]
    return found[0] if name not in header and len(found) == 1 else by_number(name, header)
