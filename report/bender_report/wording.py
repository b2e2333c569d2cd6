"""Numbers and units in words: for the terminal, the page and the sentences of `diagnosis.json`."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar

from bender_report.number import Number

_MICRO = re.compile(r"(?<![A-Za-z])um(?![A-Za-z])")
_POWER = re.compile(r"(?<=[A-Za-z)])\^?(-?\d+)")
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_LOWERED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_RIG_UNITS = r"V/[µu]m|V/\([µu]m s\)|V s/[µu]m|V/s|(?:[µu]m|V)(?:/V2?)?"
"""Units with a volt or a micrometre in them, as sentences and labels have them."""
_SMALL, _LARGE = 1e-3, 1e5
# from this many times the value on, the half-width is given beside it, not to the same digits
WIDE = 5.0
WHOSE_DELAY = (
    "a record alone cannot distinguish a delay of the sensor from one of the actuator; find that of the sensor (data "
    "sheet, or a test without the actuator); where `bender hil` drives the device, it goes into the bench file, as "
    "`delay_s` of [sensor] or [camera]"
)
"""What is to be known of a delay that was found."""
HALF_WIDTH = 1.96
"""Standard deviations to either end of an interval of 95 %."""
LOPSIDED = 0.1
"""An interval is told by its ends where one of them is further off than the other by more than this part."""
IN_WORDS = "± and (a to b) tell the interval of 95 %, which holds the true value 19 times in 20"


_shown: ContextVar[Mapping[str, str] | None] = ContextVar("units shown in the place of V and um", default=None)


@contextmanager
def shown_in(command: str, reading: str) -> Iterator[None]:
    """Show the units of another rig: where this project says V and um, its numbers are in these."""
    before = _shown.set({x: y for x, y in (("V", command), ("um", reading)) if x != y})
    try:
        yield
    finally:
        _shown.reset(before)


def unit_text(unit: str) -> str:
    """Return a unit as it is read, `µm/V²`; nothing for a pure number."""
    own = _MICRO.sub("µm", unit_name(unit)).replace(".", "·")
    return "" if own == "1" else _POWER.sub(lambda found: found[1].translate(_SUPERSCRIPTS), own)


def unit_name(unit: str) -> str:
    """Return a unit with V and um replaced by those of the rig: `(mm/s)/bar2` for `um/V2`."""
    shown = _shown.get()
    if not shown:
        return unit
    parts = re.split(r"(V|um)(?=\d|\b)", unit)
    named = [shown.get(x, x) for x in parts]
    bracketed = [
        f"({y})" if x in shown and len(unit) > len(x) and not y.isalpha() else y
        for x, y in zip(parts, named, strict=True)
    ]
    return "".join(bracketed)


def axis_text(text: str) -> str:
    """Return the label of an axis: `displacement (µm)`, of another rig `output (mm/s)`."""
    shown = _shown.get()
    if not shown:
        return text
    name, bracket, unit = text.partition(" (")
    if "V" in shown:
        name = name.replace("voltage", "input")
        unit = re.sub(r"^V\b", shown["V"], unit)
    if "um" in shown:
        name = name.replace("displacement", "output")
        unit = re.sub(r"^µm\b", shown["um"], unit)
    return f"{name}{bracket}{unit}"


def is_other_rig() -> bool:
    """Return whether the quantities shown are others than a voltage and a displacement."""
    return bool(_shown.get())


def input_word() -> str:
    """Return what the command of the rig is called: a voltage, or of another quantity the input."""
    return "input" if "V" in (_shown.get() or {}) else "voltage"


def drawable(text: str) -> str:
    """Return a text that a picture can show: a file name that is no text has a mark for each wrong byte."""
    return text.encode("utf-8", "replace").decode("utf-8")


def relabelled(text: str) -> str:
    """Return a sentence with the units of the rig behind its numbers, and in the brackets of its labels."""
    shown = _shown.get()
    if not shown:
        return text

    def own(match: re.Match[str]) -> str:
        return match[1] + unit_name(match[2].replace("µ", "u")) + match[3]

    text = re.sub(rf"(?<=\d)(\s)({_RIG_UNITS})(?![\w/²])()", own, text)
    return re.sub(rf"(\()({_RIG_UNITS})(\))", own, text)


def quantity(value: float, unit: str = "1", digits: int = 3) -> str:
    """Return a number with its unit: `0.061 µm`, `9.4 × 10⁻⁵ 1/µm²`."""
    text = figure(value, digits)
    ending = unit_text(unit)
    return f"{text} {ending}" if ending else text


def figure(value: float, digits: int = 3) -> str:
    """Return a number with some significant digits, trailing zeros left out, powers of ten as they are printed."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    if _SMALL <= abs(value) < _LARGE:
        return _plain(value, digits - 1 - math.floor(math.log10(abs(value))))
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{_plain(float(mantissa), digits - 1)} × 10{str(int(exponent)).translate(_SUPERSCRIPTS)}"


def _plain(value: float, places: int) -> str:
    text = f"{round(value, places):.{max(places, 0)}f}"
    return (text.rstrip("0").rstrip(".") if "." in text else text).replace("-", "−")


def with_interval(number: Number) -> str:
    """Return a number with its interval of 95 %: `0.0601 ± 0.0008 µm`, or `14.2 (13.7 to 16) ms` where it leans."""
    if number.interval is None:
        return uncertain(number.value, math.inf if number.std else 0.0, number.unit)
    low, high = number.interval
    below, above = number.value - low, high - number.value
    if abs(above - below) <= LOPSIDED * max(above, below):
        return uncertain(number.value, 0.5 * (high - low), number.unit)
    ending = f" {unit_text(number.unit)}" if unit_text(number.unit) else ""
    return f"{figure(number.value)} ({figure(low)} to {figure(high)}){ending}"


def uncertain(value: float, half_width: float, unit: str = "1") -> str:
    """Return a number with the half-width of its interval of 95 %, both to the digits that it leaves.

    `0.0601 ± 0.0008`; a half-width of 0 is that of a number that is fixed, an infinite one that of an unknown interval.
    """
    ending = f" {unit_text(unit)}" if unit_text(unit) else ""
    if half_width == 0.0:
        return f"{figure(value)}{ending}"
    if not math.isfinite(half_width):
        return f"{figure(value)} ± ?{ending}"
    if half_width > WIDE * abs(value):
        return f"{figure(value, 2)} ± {figure(half_width, 2)}{ending}"
    exponent = math.floor(math.log10(max(abs(value), half_width)))
    shift = exponent if not _SMALL <= max(abs(value), half_width) < _LARGE else 0
    scaled, width = value / 10.0**shift, half_width / 10.0**shift
    places = 1 - math.floor(math.log10(width))
    both = f"{_fixed(scaled, places)} ± {_fixed(width, places)}"
    if not shift:
        return f"{both}{ending}"
    return f"({both}) × 10{str(shift).translate(_SUPERSCRIPTS)}{ending}"


def _fixed(value: float, places: int) -> str:
    return f"{round(value, places):.{max(places, 0)}f}".replace("-", "−")


def plain(text: str) -> str:
    """Return a text for terminals of any encoding: minus signs, powers of ten and units in ASCII."""
    text = re.sub(r" × 10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda m: f"e{m.group(1).translate(_LOWERED)}", text)
    for sign, ascii_sign in (
        ("−", "-"),
        ("→", "->"),
        ("µ", "u"),
        ("²", "2"),
        ("…", "..."),
        ("±", "+-"),
        ("×", "x"),
        ("·", "."),
    ):
        text = text.replace(sign, ascii_sign)
    return text


def percent(share: float) -> str:
    """Return a share in per cent: `71 %`, `99.4 %` and `99.97 %` where the last per cent counts."""
    value = 100.0 * share
    rest = min(value, 100.0 - value)
    if value < 0.0 or rest < 0.005 or 5.0 <= value < 95.0:
        return f"{value:.0f} %"
    return f"{value:.2f} %" if rest < 0.05 else f"{value:.1f} %"


def chance(probability: float) -> str:
    """Return a probability as a number from 0 to 1, so that it looks like no share: `0.74`."""
    return "1" if probability == 1.0 else f"{min(max(probability, 0.01), 0.99):.2f}"


def listed(words: Sequence[str], joined: str = "and") -> str:
    """Return words as a list in a sentence: `a, b and c`."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {joined} {words[-1]}"


def with_units_kept(text: str) -> str:
    """Return a text of a page, in which a number stays on the line of its unit."""
    shown = "|".join(re.escape(unit_text(x)) for x in (_shown.get() or {}).values() if unit_text(x))
    units = rf"%|rms|(?:[uµ]m|V|s|Hz|ms{'|' + shown if shown else ''})(?![\w/])"
    return re.sub(rf"(?<=[\d⁰¹²³⁴⁵⁶⁷⁸⁹]) (?=(?:{units}))", "\u00a0", text)


def fields(numbers: Sequence[Number]) -> dict[str, list[Number]]:
    """Return numbers by the parameter that they belong to, lists together."""
    found: dict[str, list[Number]] = {}
    for number in numbers:
        found.setdefault(number.field, []).append(number)
    return found


def lower_first(title: str) -> str:
    """Return a title as it stands inside a sentence."""
    return title[:1].lower() + title[1:]
