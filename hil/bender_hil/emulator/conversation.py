"""One client's conversation with the emulated supply, whatever carries it: lines in, answers out, faults between."""

import time
from typing import Protocol

from bender_hil.emulator.instrument import Instrument


class Hangup(Exception):  # noqa: N818
    """The emulated instrument breaks the connection."""


class Wire(Protocol):
    """What carries the bytes of one conversation."""

    def send(self, data: bytes) -> None:
        """Send bytes."""
        ...


class Conversation:
    """Cuts the stream into lines, has them carried out, and lets the faults spoil the answers.

    Args:
        instrument: who answers.
        wire: where the answers go.
        end: what ends an answer.
    """

    def __init__(self, instrument: Instrument, wire: Wire, end: str) -> None:
        self._instrument = instrument
        self._wire = wire
        self._end = end.encode()
        self._buffer = b""
        self._before = "0"

    def feed(self, data: bytes) -> None:
        """Take bytes as they come; Hangup when a fault ends the connection."""
        self._buffer += data
        *lines, self._buffer = self._buffer.split(b"\n")
        if len(lines) > 1 and self._instrument.faults.reset_on_merged_writes:
            raise Hangup
        for line in lines:
            while self._instrument.faults.hung:
                time.sleep(0.005)
            answer = self._instrument.execute(line.decode("ascii", "replace").strip())
            if answer is not None:
                self._reply(answer)

    def _reply(self, answer: str) -> None:
        instrument = self._instrument
        with instrument.lock:
            faults = instrument.faults
            answer, self._before = (self._before if faults.stale else answer), answer
            spent = next((name for name in ("no_reply", "garble", "truncate") if getattr(faults, name) > 0), None)
            if spent is not None:
                instrument.faults = faults.with_fault(spent, getattr(faults, spent) - 1)
        if faults.delay_s:
            time.sleep(faults.delay_s)
        if spent != "no_reply":
            self._wire.send(self._spoiled(answer, spent))

    def _spoiled(self, answer: str, fault: str | None) -> bytes:
        data = answer.encode("ascii", "replace")
        if fault == "truncate":
            return data[: len(data) // 2]
        if fault == "garble":
            data = bytes([data[0] ^ 0x40, *data[1:]])
        return data + self._end
