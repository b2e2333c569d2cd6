"""Answers, read strictly: a wrong or damaged one is an error and never a number."""

import math
import re
from typing import NamedTuple

from bender_hil.supply.failures import BadReplyError

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_ERROR = re.compile(r"([+-]?\d+)(?:\s*,\s*\"?([^\"]*)\"?)?", re.ASCII)
_SHOWN = 80
_SWITCH = {"0": False, "1": True, "OFF": False, "ON": True}


class Identity(NamedTuple):
    """What `*IDN?` says."""

    manufacturer: str
    model: str
    serial: str
    firmware: str

    @property
    def is_emulated(self) -> bool:
        """Whether it is an emulator, which says so in its serial number."""
        return self.serial.startswith("EMU")


def number(question: str, answer: str) -> float:
    """The finite number that `answer` is; BadReplyError for anything else."""
    if _NUMBER.fullmatch(answer.strip()) is None or not math.isfinite(float(answer)):
        raise _bad(question, answer, "a finite number")
    return float(answer)


def switch(question: str, answer: str) -> bool:
    """0, 1, OFF or ON; BadReplyError for anything else."""
    try:
        return _SWITCH[answer.strip().upper()]
    except KeyError:
        raise _bad(question, answer, "0 or 1") from None


def complaint(question: str, answer: str) -> str | None:
    """The complaint in an answer of the error queue, None for "no error"; BadReplyError for anything else."""
    found = _ERROR.fullmatch(answer.strip())
    if found is None:
        raise _bad(question, answer, 'a code and a text, as 0,"No error"')
    return None if int(found[1]) == 0 else answer.strip()


def identity(question: str, answer: str) -> Identity:
    """The four fields of an identification; BadReplyError for anything else."""
    fields = [field.strip() for field in answer.split(",")]
    if len(fields) != 4 or not all(fields):
        raise _bad(question, answer, "manufacturer, model, serial, firmware")
    return Identity(*fields)


def _bad(question: str, answer: str, expected: str) -> BadReplyError:
    return BadReplyError(f"{question} was answered with {answer[:_SHOWN]!r}, expected {expected}")
