"""What emulated sensors that speak SCPI have in common: a table of commands and one of questions, an error queue."""

import threading
from abc import ABC, abstractmethod
from collections import deque

from bender_emulator.faults import Faults
from bender_emulator.instrument import Handler, ScpiError
from bender_emulator.scpi_header import header_pattern, split_command
from bender_emulator.sensors.transducer import Transducer

_ERRORS_KEPT = 20


class ScpiSensor(ABC):
    """State and language of one sensor; every method may be called from any thread.

    Args:
        transducer: what is at its terminals.
    """

    line_end = b"\n"
    prompt = b""

    def __init__(self, transducer: Transducer) -> None:
        self._transducer = transducer
        self._errors: deque[int] = deque(maxlen=_ERRORS_KEPT)
        self.power_on()
        self._commands, self._questions = self._tables()

    @property
    def lock(self) -> threading.RLock:
        """Held while faults change."""
        return self._transducer.lock

    @property
    def faults(self) -> Faults:
        """What is wrong at present."""
        return self._transducer.faults

    @faults.setter
    def faults(self, faults: Faults) -> None:
        self._transducer.faults = faults

    @abstractmethod
    def power_on(self) -> None:
        """As it comes up."""

    @abstractmethod
    def _tables(self) -> tuple[dict[str, Handler], dict[str, Handler]]:
        """Return what its commands and its questions do, by their headers."""

    def execute(self, line: str) -> str | None:
        """Carry out one line; returns the answer, None when there is none."""
        header, is_question, parameters = split_command(line)
        if not header:
            return None
        for pattern, handler in (self._questions if is_question else self._commands).items():
            if header_pattern(pattern).fullmatch(header):
                try:
                    answer = handler(parameters)
                    return answer if is_question else None
                except ScpiError as error:
                    self._errors.append(error.code)
                    return None
        self._errors.append(-113)
        return None
