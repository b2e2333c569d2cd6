"""One client's conversation with the emulated supply, whatever carries it: lines in, answers out, faults between."""

import contextlib
import threading
import time
from typing import Protocol

from bender_emulator.faults import Faults


class Hangup(Exception):  # noqa: N818
    """The emulated instrument breaks the connection."""


class Answering(Protocol):
    """What carries out lines: an emulated instrument."""

    line_end: bytes
    prompt: bytes

    @property
    def faults(self) -> Faults:
        """What is wrong at present."""
        ...

    @faults.setter
    def faults(self, faults: Faults) -> None: ...

    @property
    def lock(self) -> threading.RLock:
        """Held while faults change."""
        ...

    def execute(self, line: str) -> str | None:
        """Carry out one line; returns the answer, None when there is none."""
        ...


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

    def __init__(self, instrument: Answering, wire: Wire, end: str) -> None:
        self._instrument = instrument
        self._wire = wire
        self._end = end.encode()
        self._buffer = b""
        self._before = "0"
        self._is_flooding = False

    def feed(self, data: bytes) -> None:
        """Take bytes as they come; Hangup when a fault ends the connection."""
        self._buffer += data
        *lines, self._buffer = self._buffer.split(self._instrument.line_end)
        if len(lines) > 1 and self._instrument.faults.reset_on_merged_writes:
            raise Hangup
        for line in lines:
            self._wait()
            if self._instrument.faults.flood:
                self._flood()
            if self._is_spent("lost_lines"):
                continue
            if self._instrument.faults.echo:
                self._wire.send(line + b"\n")
            answer = self._instrument.execute(line.decode("ascii", "replace").strip())
            if answer is not None:
                self._reply(answer)
            if self._instrument.prompt:
                self._wire.send(self._instrument.prompt)

    def _wait(self) -> None:
        instrument = self._instrument
        with instrument.lock:
            hung_s = instrument.faults.hung_s
            instrument.faults = instrument.faults.with_fault("hung_s", 0.0)
        time.sleep(hung_s)
        while instrument.faults.hung:
            time.sleep(0.005)

    def _is_spent(self, name: str) -> bool:
        """Whether a fault that is counted happens now; it has happened once more then."""
        instrument = self._instrument
        with instrument.lock:
            count = getattr(instrument.faults, name)
            if count > 0:
                instrument.faults = instrument.faults.with_fault(name, count - 1)
        return count > 0

    def _reply(self, answer: str) -> None:
        instrument = self._instrument
        if self._is_spent("drops"):
            raise Hangup
        with instrument.lock:
            faults = instrument.faults
            answer, self._before = (self._before if faults.stale else answer), answer
        spent = next((name for name in ("no_reply", "garble", "truncate") if self._is_spent(name)), None)
        if faults.delay_s:
            time.sleep(faults.delay_s)
        if spent == "no_reply":
            return
        data = self._spoiled(faults.answer or answer, spent)
        if faults.no_end:
            data = data.removesuffix(self._end)
        if faults.drip_s:
            threading.Thread(target=self._drip, args=(data, faults.drip_s), daemon=True).start()
        else:
            self._wire.send(data * (2 if faults.twice else 1))

    def _drip(self, data: bytes, drip_s: float) -> None:
        with contextlib.suppress(OSError):
            for byte in data:
                time.sleep(drip_s)
                self._wire.send(bytes([byte]))

    def _flood(self) -> None:
        if self._is_flooding:
            return
        self._is_flooding = True
        threading.Thread(target=self._pour, daemon=True).start()

    def _pour(self) -> None:
        with contextlib.suppress(OSError):
            while kind := self._instrument.faults.flood:
                self._wire.send(b"#" * 64 + (self._end if kind == "lines" else b""))
                time.sleep(0.0005)
        self._is_flooding = False

    def _spoiled(self, answer: str, fault: str | None) -> bytes:
        data = answer.encode("latin-1", "replace")
        if fault == "truncate":
            return data[: len(data) // 2]
        if fault == "garble":
            data = bytes([data[0] ^ 0x40, *data[1:]])
        return data + self._end
