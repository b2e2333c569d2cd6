"""SCPI headers: `[SOURce:]VOLTage[:LEVel]` stands for SOUR:VOLT, VOLT:LEV, voltage and so on."""

import re
from functools import cache

_PART = re.compile(r"([A-Z]+)([a-z]*)")


@cache
def header_pattern(header: str) -> re.Pattern[str]:
    """What matches a header as manuals print it: short form in capitals, parts that may be left out in brackets.

    A leading colon is allowed, either case is, and nothing between the short and the long form is.
    """
    text = re.escape(header).replace(r"\[", "(?:").replace(r"\]", ")?")
    return re.compile(":?" + _PART.sub(_both_forms, text), re.IGNORECASE)


def _both_forms(part: re.Match[str]) -> str:
    short, rest = part.groups()
    return f"{short}(?:{rest})?" if rest else short


def split_command(command: str) -> tuple[str, bool, str]:
    """Header, whether it is a question, and the parameters of one command."""
    header, _, parameters = command.strip().partition(" ")
    return header.removesuffix("?"), header.endswith("?"), parameters.strip()
