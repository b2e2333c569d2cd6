"""How a table stands in a text file: encoding, delimiter, decimal sign, header, units; given or found.

What is not given is found from the lines themselves: the delimiter under which most lines split into the same number of
numeric cells, the decimal sign under which these are numbers, the header above the first of them.
"""

import csv
import io
import math
import re
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

from bender_loop.errors import InputError
from bender_loop.tables.quantities import is_known

DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "bar": "|", "spaces": " "}
"""Names of the delimiters, in the order in which ties are broken."""
ENCODINGS = ("utf-8", "utf-16", "utf-16-le", "utf-16-be", "cp1252", "latin-1")
COMMENT_MARKS = ("#", "%", "//")
SAMPLE_LINES = 400
LONG_CHARACTERS = 1 << 20
"""From here on a table is read in blocks where it is even; cell by cell it would take some hundred bytes a cell."""
LEAST_NUMERIC = 0.6
"""Part of the sampled lines that must split into the same number of numeric cells."""
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(\.\d{3})+(,\d*)?")
_BRACKETED = re.compile(r"[\[(]\s*([^\])]*?)\s*[\])]\s*$")
_SLASHED = re.compile(r"(?:.*\S\s+/\s+|[^\s/]+/)(\S+)")
_QUOTIENT = re.compile(r".*[_ ]([^\s_/]+/[^\s_/]+)")

_AT_END = re.compile(r"(.*[^\s_].*)_([^\W\d_]+)")
_MARKED = re.compile(r"[a-zµμ]+[A-Z][A-Za-z]*|[A-Z]{2}[a-z]+")
_DRIVEN_BY_CURRENT = re.compile(r"(?:^|[\W_])(?:i|current|strom|drive|command|coil|input|u)$", re.IGNORECASE)
_USUAL_ENDINGS = frozenset({
    "V", "N", "K", "W", "Nm", "Pa", "Hz", "percent", "pct", "rpm", "rps", "bar", "mbar", "psi", "degC", "degF",
    "celsius", "kelvin", "deg", "rad", "ms", "us", "ns", "sec", "seconds", "msec", "usec", "um", "µm", "μm", "nm", "mm",
    "cm", "km", "inch", "volt", "volts", "ohm", "kg", "mg", "ppm", "kph", "mps",
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class TextLayout:
    """How to read a text file; None is found from the file.

    Attributes:
        delimiter: one character, " " for any white space.
        decimal: "." or ",".
        encoding: a name that Python knows.
        skip_rows: lines at the top that are not read at all.
        header: whether a line of names stands above the numbers.

    Raises:
        ValueError: a value is not one of those.
    """

    delimiter: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    skip_rows: int = 0
    header: bool | None = None

    def __post_init__(self) -> None:
        if self.delimiter is not None and (len(self.delimiter) != 1 or self.delimiter.isalnum()):
            raise ValueError(f"delimiter: found {self.delimiter!r}, expected one of {', '.join(DELIMITERS)}")
        if self.decimal not in (None, ".", ","):
            raise ValueError(f"decimal: found {self.decimal!r}, expected . or ,")
        if self.decimal is not None and self.decimal == self.delimiter:
            raise ValueError(f"decimal: found {self.decimal!r}, which is the delimiter too")
        if self.encoding is not None:
            try:
                "".encode(self.encoding)
            except LookupError:
                raise ValueError(f"encoding: found {self.encoding!r}, expected one as {', '.join(ENCODINGS)}") from None
        if self.skip_rows < 0:
            raise ValueError(f"skip_rows: found {self.skip_rows}, expected 0 or more")

    @property
    def is_found(self) -> bool:
        """Whether nothing is given."""
        return self == TextLayout()


@dataclass(frozen=True, slots=True)
class Cells:
    """The cells of a table in a text file, with what was found of its layout.

    Attributes:
        header: column names, or their numbers from 1 where the file has none.
        units: text of the units' line or of the brackets in the header, "" where there is none; one per column.
        rows: cells of the data rows.
        lines: line number of each row, from 1.
        decimal: the decimal sign.
        told: how the file was read, for one line of output; "" for the plain form of a record.
        delimiter: between the cells.
        names_line: line number of the header, None where the file has none.
    """

    header: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[list[str], ...]
    lines: tuple[int, ...]
    decimal: str
    told: str
    delimiter: str
    names_line: int | None


def decoded(path: Path, data: bytes, layout: TextLayout) -> tuple[str, str]:
    """Return the text of a file and the name of its encoding.

    Raises:
        InputError: the bytes are not text in the given encoding, or in any that is tried.
    """
    if layout.encoding is not None:
        try:
            return data.decode(layout.encoding).removeprefix("\ufeff"), layout.encoding
        except UnicodeDecodeError as error:
            raise InputError(
                f"{path}: byte {error.start} is not {layout.encoding} text; name another --encoding"
            ) from None
    if data[:2] in (b"\xff\xfe", b"\xfe\xff") or _alternating_zeros(data):
        names = ("utf-16",) if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ("utf-16-le", "utf-16-be")
        for name in names:
            try:
                text = data.decode(name)
            except UnicodeDecodeError:
                continue
            if "\x00" not in text:
                return text.removeprefix("\ufeff"), name
    if (place := data.find(0)) >= 0:
        raise InputError(f"{path}: byte {place} is zero, so this is no text; expected a table (CSV), or a known ending")
    try:
        return data.decode("utf-8-sig"), "utf-8"
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace"), "cp1252"


def _alternating_zeros(data: bytes) -> bool:
    sample = data[:200]
    return len(sample) >= 8 and len(sample) % 2 == 0 and (not any(sample[1::2]) or not any(sample[0::2]))


def number(cell: str, decimal: str) -> float:
    """Return a cell as a number.

    Raises:
        ValueError: it is none.
    """
    cell = cell.strip()
    if "_" in cell:
        raise ValueError(cell)
    if decimal == ",":
        if _THOUSANDS.fullmatch(cell):
            cell = cell.replace(".", "")
        elif "." in cell:
            raise ValueError(cell)
        cell = cell.replace(",", ".")
    return float(cell)


def cells_of(path: Path, text: str, encoding: str, layout: TextLayout) -> Cells:
    """Return the cells of a table whose layout is found where it is not given.

    Raises:
        InputError: no delimiter splits the lines into numbers, or a row is of another length.
    """
    lines = text.splitlines()
    numbered = [
        (k + 1, line)
        for k, line in enumerate(lines)
        if k >= layout.skip_rows and line.strip() and not line.lstrip().startswith(COMMENT_MARKS)
    ]
    if not numbered:
        raise InputError(f"{path}: the file is empty, expected a header line and rows of numbers")
    delimiter, decimal = _separators(path, [line for _, line in numbered], layout)
    split = [(k, _split(line, delimiter)) for k, line in numbered]
    width = _usual_width([cells for _, cells in split], decimal)
    first = _first_data_row(split, width, decimal)
    above = [(k, cells) for k, cells in split[:first] if len(_trimmed(cells)) >= 2]
    filled, width = width, _named_width(above, split[first:], width)
    header, units, names_line = _header(above, width, layout)
    rows, at = [], []
    for k, cells in split[first:]:
        cells = _fitted(cells, width, filled)
        if len(cells) != width:
            raise InputError(f"{path}, line {k}: found {len(cells)} cells, expected {width} as in most lines")
        rows.append(cells)
        at.append(k)
    told = _describe_layout(
        encoding, delimiter, decimal, names_line, bool(units and names_line is not None and any(units))
    )
    padded = tuple((*units, *[""] * width)[:width])
    return Cells(header, padded, tuple(rows), tuple(at), decimal, told, delimiter, names_line)


def outline(path: Path, text: str, encoding: str, layout: TextLayout) -> tuple[str, Cells] | None:
    """Return the rows of a long table as text and what its first and last lines tell of it, None for a short one.

    Remarks may stand above the rows only: with a mark of one in a row, the table is read line by line.

    Raises:
        InputError: as `cells_of` raises it.
    """
    if len(text) < LONG_CHARACTERS:
        return None
    begin = _end_of_line(text, 2 * SAMPLE_LINES)
    end = len(text)
    for _ in range(2 * SAMPLE_LINES):
        end = max(text.rfind("\n", 0, end - 1) + 1, 0)
    head = text[:begin]
    if begin >= end or len(head.splitlines()) != head.count("\n"):  # lines that end in another way
        return None
    seen = cells_of(path, text[:begin] + text[end:], encoding, layout)
    start = _end_of_line(text, seen.lines[0] - 1) if seen.lines else len(text)
    if start >= begin or any(mark in text[start:] for mark in COMMENT_MARKS):
        return None
    return text[start:], seen


def _end_of_line(text: str, lines: int) -> int:
    """Return the place behind so many lines."""
    at = 0
    for _ in range(lines):
        at = text.find("\n", at) + 1
        if at == 0:
            return len(text)
    return at


def unit_in_heading(name: str) -> str:
    """Return the unit in a column's name; "" without one.

    In brackets at its end, a quotient behind it (`speed_rad/s`), behind a slash (`t / ms`), or behind the last
    underscore (`T_degC`).
    """
    if in_brackets := _in_brackets(name):
        return in_brackets
    for form in (_QUOTIENT, _SLASHED):
        told = form.fullmatch(name.strip())
        if told and is_known(told.group(1)):
            return told.group(1)
    return unit_at_end(name)


def unit_at_end(name: str) -> str:
    """Return the unit behind the last underscore of a column's name, "" where what stands there may be a word.

    Short units are words too (`x_in`, `y_min`, `sensor_a`): a lone letter counts where it is usual, more of them in
    small letters where they are listed, others where a prefix or a capital inside marks them (`kPa`, `degC`).
    """
    told = _AT_END.fullmatch(name.strip())
    if told is None:
        return ""
    before, unit = told.groups()
    if unit == "A":
        return unit if _DRIVEN_BY_CURRENT.search(before) else ""
    if unit in _USUAL_ENDINGS:
        return unit
    return unit if _MARKED.fullmatch(unit) and is_known(unit) else ""


def _in_brackets(name: str) -> str:
    found = _BRACKETED.search(name)
    return found.group(1) if found else ""


def _separators(path: Path, lines: list[str], layout: TextLayout) -> tuple[str, str]:
    sample = lines[-SAMPLE_LINES:]
    delimiters = [layout.delimiter] if layout.delimiter else list(DELIMITERS.values())
    best: tuple[tuple[float, float], str, str] | None = None
    for delimiter in delimiters:
        for decimal in [layout.decimal] if layout.decimal else [".", ","]:
            if decimal == delimiter:
                continue
            score = _numeric_share(sample, delimiter, decimal)
            if best is None or score > best[0]:
                best = (score, delimiter, decimal)
    if best is None or best[0][0] < LEAST_NUMERIC:
        raise InputError(
            f"{path}: found no columns of numbers under any delimiter ({', '.join(DELIMITERS)}); "
            "name --delimiter, --decimal, --skip-rows, or give a table with one row of numbers a line"
        )
    return best[1], best[2]


def _split(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return line.split()
    try:
        return next(csv.reader(io.StringIO(line), delimiter=delimiter, strict=True), [])
    except csv.Error:
        return line.split(delimiter)


def _numeric_share(lines: list[str], delimiter: str, decimal: str) -> tuple[float, float]:
    """Return the part of the lines with the usual number of cells, two of them numbers; and that of numeric cells."""
    split = [_split(line, delimiter) for line in lines]
    width = _usual_width(split, decimal)
    if width < 2:
        return 0.0, 0.0
    good = [len(_fitted(cells, width)) == width and sum(_is_number(x, decimal) for x in cells) >= 2 for cells in split]
    # lines above the first row of numbers are names, units and remarks
    first = good.index(True) if True in good else 0
    cells = [x for row in split[first:] for x in row if x.strip()]
    return sum(good) / len(good[first:]), sum(_is_number(x, decimal) for x in cells) / max(len(cells), 1)


def _usual_width(split: list[list[str]], decimal: str) -> int:
    widths = Counter(len(_trimmed(x)) for x in split if sum(_is_number(y, decimal) for y in x) >= 2)
    return widths.most_common(1)[0][0] if widths else 0


def _trimmed(cells: list[str]) -> list[str]:
    end = len(cells)
    while end and not cells[end - 1].strip():
        end -= 1
    return cells[:end]


def _fitted(cells: list[str], width: int, filled: int | None = None) -> list[str]:
    """Return the cells without empty ones beyond the width, and with empty ones where the end of a row is missing.

    Args:
        cells: of a row.
        width: number of columns.
        filled: number of columns that most rows fill, where the others are mostly empty.
    """
    if len(cells) > width and not any(x.strip() for x in cells[width:]):
        return cells[:width]
    least = (filled or width) - 1
    return [*cells, *[""] * (width - len(cells))] if least <= len(cells) < width else cells


def _named_width(above: list[tuple[int, list[str]]], below: list[tuple[int, list[str]]], width: int) -> int:
    """Return the number of columns where the header names more than most rows fill: one for remarks, mostly empty."""
    named = len(_trimmed(above[-1][1])) if above else 0
    return max(width, named if named <= max((len(cells) for _, cells in below), default=0) else 0)


def _is_number(cell: str, decimal: str) -> bool:
    try:
        return not math.isnan(number(cell, decimal))
    except ValueError:
        return False


def _first_data_row(split: list[tuple[int, list[str]]], width: int, decimal: str) -> int:
    for k, (_, cells) in enumerate(split):
        if len(_fitted(cells, width)) == width and sum(_is_number(x, decimal) for x in cells) >= 2:
            return k
    return len(split)


def _header(
    above: list[tuple[int, list[str]]], width: int, layout: TextLayout
) -> tuple[tuple[str, ...], tuple[str, ...], int | None]:
    """Return names, units, and the line of the names; numbers as names where there is no header."""
    numbers = tuple(str(k + 1) for k in range(width))
    fitting = [(k, _fitted(cells, width)) for k, cells in above]
    fitting = [(k, cells) for k, cells in fitting if len(cells) == width]
    if layout.header is False or not fitting:
        return numbers, (), None
    units: tuple[str, ...] = ()
    if len(fitting) > 1 and all(_looks_like_a_unit(x) for x in fitting[-1][1]):
        units = tuple(_in_brackets(x) or x.strip() for x in fitting[-1][1])
        fitting = fitting[:-1]
    line, cells = fitting[-1]
    names = tuple(x.strip() or str(k + 1) for k, x in enumerate(cells))
    return names, units or tuple(unit_in_heading(x) for x in names), line


def _looks_like_a_unit(cell: str) -> bool:
    alone = cell.strip().startswith(("[", "("))
    inside = (_in_brackets(cell) if alone else "") or cell.strip()
    return len(inside) <= 5 and not any(x.isdigit() for x in inside)


def _describe_layout(encoding: str, delimiter: str, decimal: str, header: int | None, units: bool) -> str:
    name = next((k for k, v in DELIMITERS.items() if v == delimiter), repr(delimiter))
    parts = [f"delimiter {name}", f"decimal {'comma' if decimal == ',' else 'point'}", encoding]
    parts.append("no header, columns by number" if header is None else f"names in line {header}")
    if units:
        parts.append("units from the file")
    return ", ".join(parts)


def with_options(layout: TextLayout, **given: str | int | bool | None) -> TextLayout:
    """Return the layout with what is given; a delimiter may be named in words (`tab`, `semicolon`).

    Raises:
        ValueError: a value is not one of those that a layout takes.
    """
    known = {name: value for name, value in given.items() if value is not None}
    word = known.get("delimiter")
    if isinstance(word, str):
        known["delimiter"] = DELIMITERS.get(word, "\t" if word == "\\t" else word)
    return replace(layout, **known)  # pyright: ignore[reportArgumentType]
