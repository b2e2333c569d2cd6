"""What a check found, why it matters and what to do about it."""

from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")
LEAVING = "leaving the process"
"""The last stage of a trial run; a process that ends in an earlier one was ended by the FMU."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding.

    Attributes:
        severity: an error breaks the standard or a run, a warning breaks some tools, a note is good to know.
        what: what was found and where, in one line.
        why: what it leads to.
        remedy: what to do about it.
    """

    severity: Severity
    what: str
    why: str
    remedy: str

    def __post_init__(self) -> None:
        if self.severity not in SEVERITIES:
            raise ValueError(f"severity must be one of {', '.join(SEVERITIES)}, found {self.severity!r}")


def error(what: str, why: str, remedy: str) -> Finding:
    """A finding that breaks the standard or a run."""
    return Finding("error", what, why, remedy)


def warning(what: str, why: str, remedy: str) -> Finding:
    """A finding that breaks some tools."""
    return Finding("warning", what, why, remedy)


def note(what: str, why: str, remedy: str) -> Finding:
    """A finding that is good to know."""
    return Finding("note", what, why, remedy)


def one_line(problem: object) -> str:
    """The text of a problem in one line, the name of its class where it has none."""
    return " ".join(str(problem).split()) or type(problem).__name__
