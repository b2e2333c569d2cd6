"""Text on a stream that cannot show every sign: the one place where `µm` becomes `um`.

Texts for people are written with the signs that they are printed with. A stream in UTF-8 shows them as they are; one
in ASCII or an old code page gets the nearest ASCII in their place, and never ends a run.
"""

import codecs
import contextlib
import re
from typing import TextIO

IN_ASCII = {
    "µ": "u", "μ": "u", "−": "-", "–": "-", "—": "-", "→": "->", "…": "...", "±": "+-", "×": "x", "·": ".",
    "≤": "<=", "≥": ">=", "≈": "~", "°": " deg", "\u00a0": " ", "ω": "omega", "ζ": "zeta", "τ": "tau",
}  # fmt: skip
_POWER_OF_TEN = re.compile("(?<=[0-9])(?=[⁻⁰¹²³⁴⁵⁶⁷⁸⁹])")
_LOWERED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_HANDLER = "readable"


def in_ascii(text: str) -> str:
    """Return a text in ASCII: `um`, `V2`, `->`, `10^-5`; a question mark for a sign that has nothing near it."""
    text = _POWER_OF_TEN.sub("^", text).translate(_LOWERED)
    return "".join(x if x.isascii() else IN_ASCII.get(x, "?") for x in text)


def make_readable(stream: TextIO) -> None:
    """Let a stream write what its encoding cannot show in ASCII; one that is no file stays as it is."""
    codecs.register_error(_HANDLER, _replaced)
    with contextlib.suppress(AttributeError):
        stream.reconfigure(errors=_HANDLER)  # pyright: ignore[reportAttributeAccessIssue]


def _replaced(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    before = error.object[max(error.start - 1, 0) : error.start]
    return in_ascii(before + error.object[error.start : error.end])[len(before) :], error.end
