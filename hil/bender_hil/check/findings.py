"""Findings: what was looked at, how it stands, what to do."""

from dataclasses import dataclass

FINE, REMARK, FAILED = "fine", "remark", "failed"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of a check.

    Attributes:
        what: was looked at.
        state: FINE, REMARK or FAILED.
        found: in words.
        advice: what to do about it; "" for nothing.
    """

    what: str
    state: str
    found: str
    advice: str = ""
