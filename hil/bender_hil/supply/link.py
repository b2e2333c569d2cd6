"""The wire to an instrument, over PyVISA.

What PyVISA with its pure Python backend leaves to its user, found by trial: a socket keeps Nagle's algorithm on, so a
command and a question after it cost 40 ms; a closed port opens without complaint and shows itself with the first
command; after a timeout the late answer is taken for the answer to the next question; an answer that drips restarts
the timeout with every byte. Here a whole answer has one deadline, however its bytes come.
"""

import contextlib
import time
from dataclasses import dataclass
from typing import Any, Protocol

from bender_hil.supply.failures import BadReplyError, LinkLostError, NoReplyError
from bender_hil.supply.patience import SLICE_S, Patience
from bender_hil.supply.port_lock import PortLock
from bender_hil.supply.stream import Stream, stream_of
from bender_loop.errors import InputError
from bender_loop.shell.extras import install_command

_QUIET_S = 0.03
_BITS_PER_BYTE = 10
_OPEN_S, _REOPEN_S = 1.0, 0.5
"""For a connection: at leisure, and on the way down."""
_LONGEST_ANSWER = 4096
"""Bytes; the longest answer in any of the dialects has some 60."""


@dataclass(frozen=True, slots=True)
class LinkSettings:
    """How to reach an instrument.

    Attributes:
        resource: VISA address, as `TCPIP::192.168.1.7::5025::SOCKET`, `ASRL/dev/ttyUSB0::INSTR`, `USB0::...::INSTR`.
        write_end: what ends a command.
        read_end: what ends an answer.
        timeout_s: how long to wait for an answer.
        baud: of a serial line.
        spacing_s: shortest time between two commands, for instruments that lose them otherwise.
        backend: of PyVISA.

    Raises:
        ValueError: a value is out of its range.
    """

    resource: str
    write_end: str = "\n"
    read_end: str = "\n"
    timeout_s: float = 0.25
    baud: int = 57600
    spacing_s: float = 0.0
    backend: str = "py"

    def __post_init__(self) -> None:
        if not 0.01 <= self.timeout_s <= 10.0:
            raise ValueError(f"timeout_s must lie within 0.01 and 10, found {self.timeout_s!r}")
        if self.baud <= 0:
            raise ValueError(f"baud must be > 0, found {self.baud!r}")
        if not 0.0 <= self.spacing_s <= 1.0:
            raise ValueError(f"spacing_s must lie within 0 and 1, found {self.spacing_s!r}")

    @property
    def is_serial(self) -> bool:
        """Whether bytes take their time on the line."""
        return self.resource.upper().startswith("ASRL")


class Link(Protocol):
    """Lines out, lines in."""

    patience: Patience

    def open(self) -> None:
        """Open; LinkLostError where there is nothing to open."""
        ...

    def write(self, text: str) -> float:
        """Send a command; returns `time.perf_counter` when its last byte was on the wire. LinkLostError."""
        ...

    def query(self, text: str) -> str:
        """Send a question, return the answer without its end. NoReplyError, LinkLostError."""
        ...

    def drain(self) -> None:
        """Throw away whatever comes until the line is quiet."""
        ...

    def close(self) -> None:
        """Close; never raises."""
        ...


class LineLink(Link, Protocol):
    """A link on which more than one line may come."""

    def answer(self, text: str) -> str:
        """Return the next line without its end; `text` is what asked for it. NoReplyError, LinkLostError."""
        ...


class VisaLink:
    """A link over PyVISA.

    Args:
        settings: the address and its manners.

    Attributes:
        patience: bounds every wait beside the timeout of the settings.
    """

    def __init__(self, settings: LinkSettings) -> None:
        self._settings = settings
        self._resource: Any = None
        self._manager: Any = None
        self._stream: Stream | None = None
        self._lock: PortLock | None = None
        self._owed = b""
        self._free_s = 0.0
        self.patience = Patience()
        # takes long, and may be counted as silence later; where it is not installed, opening says so
        with contextlib.suppress(InputError):
            _visa(settings.backend)

    def open(self) -> None:
        """Open the address.

        Raises:
            InputError: PyVISA is not installed, or the address is not a VISA address.
            LinkLostError: there is nothing to open, or another process has the serial port.
        """
        settings = self._settings
        visa = _visa(settings.backend)
        self.close()
        self.patience.waiting()
        left_s = self.patience.left_s(_OPEN_S)
        open_s = left_s if left_s == _OPEN_S else max(0.05, min(left_s, _REOPEN_S))
        try:
            self._manager = self._manager or visa.ResourceManager(f"@{settings.backend}")
            self._lock = _locked(settings.resource) if settings.backend == "py" else None
            self._resource = self._manager.open_resource(settings.resource, open_timeout=round(1000.0 * open_s))
            if settings.is_serial:
                self._resource.baud_rate = settings.baud
            if settings.backend != "py":
                self._resource.read_termination = settings.read_end
            self._stream = stream_of(self._resource, SLICE_S, settings.timeout_s)
        except LinkLostError:
            self.close()
            raise
        except Exception as error:  # the backend raises whatever its own parts raise, bare Exception among them
            self.close()
            raise _not_opened(settings.resource, error) from error

    def write(self, text: str) -> float:
        """Send a command; returns when its last byte was on the wire, as `time.perf_counter`."""
        settings = self._settings
        stream = self._opened()
        if settings.spacing_s:
            self.patience.pause(self._free_s - time.perf_counter())
        data = (text + settings.write_end).encode("ascii")
        try:
            # also after the deadline: what is never sent has no effect at all
            stream.send(data, max(SLICE_S, self.patience.left_s(settings.timeout_s)))
        except Exception as error:  # see `open`
            raise LinkLostError(f"{settings.resource}: {text} could not be sent ({_words(error)})") from error
        sent_s = time.perf_counter()
        if settings.is_serial:
            sent_s += len(data) * _BITS_PER_BYTE / settings.baud
        self._free_s = sent_s + settings.spacing_s
        return sent_s

    def query(self, text: str) -> str:
        """Send a question, return the answer without its end; the whole answer has one deadline."""
        self.write(text)
        return self.answer(text)

    def answer(self, text: str) -> str:
        """Return the next line without its end; `text` is what asked for it, for the words of an error."""
        settings, end = self._settings, self._settings.read_end.encode("ascii")
        what = f"answer to {text}" if text else "line"
        allowed_s = self.patience.left_s(settings.timeout_s)
        limit_s = time.perf_counter() + allowed_s
        while end not in self._owed:
            left_s = limit_s - time.perf_counter()
            if left_s <= 0.0:
                part, self._owed = self._owed, b""
                came = f"; only {part[:40]!r} came" if part else ""
                raise NoReplyError(f"{settings.resource}: no {what} within {allowed_s:.3g} s{came}")
            if len(self._owed) > _LONGEST_ANSWER:
                part, self._owed = self._owed, b""
                raise BadReplyError(
                    f"{settings.resource}: found {len(part)} bytes without an end as the {what}: {part[:40]!r} ..."
                )
            self.patience.waiting()
            try:
                self._owed += self._opened().some(min(left_s, SLICE_S))
            except Exception as error:  # see `open`
                raise LinkLostError(f"{settings.resource}: no {what} ({_words(error)})") from error
        answer, _, self._owed = self._owed.partition(end)
        return answer.decode("ascii", "replace")

    def has_line(self) -> bool:
        """Whether a whole line has come already."""
        return self._settings.read_end.encode("ascii") in self._owed

    def drain(self) -> None:
        """Throw away what comes until nothing came for 30 ms, for at most a timeout."""
        stream, self._owed = self._stream, b""
        if stream is None:
            return
        limit_s = time.perf_counter() + self.patience.left_s(self._settings.timeout_s)
        with contextlib.suppress(Exception):
            while time.perf_counter() < limit_s:
                self.patience.waiting()
                if not stream.some(_QUIET_S):
                    return

    def close(self) -> None:
        """Close; a second call does nothing."""
        resource, self._resource, self._stream, self._owed = self._resource, None, None, b""
        if resource is not None:
            with contextlib.suppress(Exception):
                resource.close()
        lock, self._lock = self._lock, None
        if lock is not None:
            lock.release()

    def _opened(self) -> Stream:
        if self._stream is None:
            raise LinkLostError(f"{self._settings.resource}: the link is closed")
        return self._stream


def _locked(resource: str) -> PortLock | None:
    """A lock on the serial port that a VISA address names, None for any other address."""
    kind, _, rest = resource.partition("::")
    path = kind[len("ASRL") :]
    if not kind.upper().startswith("ASRL") or rest.upper() not in ("", "INSTR") or not path.startswith("/"):
        return None
    return PortLock(path)


def _visa(backend: str) -> Any:
    try:
        import pyvisa

        if backend == "py":
            import pyvisa_py  # noqa: F401
            import serial  # noqa: F401
    except ImportError as error:
        raise InputError(f"the bench needs {error.name}: {install_command('bench')}") from error
    return pyvisa


def _not_opened(resource: str, error: Exception) -> Exception:
    if type(error).__name__ == "VisaIOError" and "INV_RSRC_NAME" in str(error):
        return InputError(f"{resource}: is not a VISA address, expected one like TCPIP::192.168.1.7::5025::SOCKET")
    return LinkLostError(f"{resource}: cannot be opened ({_words(error)})")


def _words(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
