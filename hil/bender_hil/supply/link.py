"""The wire to an instrument, over PyVISA.

What PyVISA with its pure Python backend leaves to its user, found by trial: a socket keeps Nagle's algorithm on, so a
command and a question after it cost 40 ms; a peer that has gone away is seen as a timeout only; a closed port opens
without complaint and shows itself with the first command; after a timeout the late answer is taken for the answer to
the next question.
"""

import contextlib
import socket
import time
from dataclasses import dataclass
from typing import Any, Protocol

from bender_hil.supply.failures import LinkLostError, NoReplyError
from bender_loop.errors import InputError

_QUIET_S = 0.03
_BITS_PER_BYTE = 10


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


class VisaLink:
    """A link over PyVISA.

    Args:
        settings: the address and its manners.
    """

    def __init__(self, settings: LinkSettings) -> None:
        self._settings = settings
        self._resource: Any = None
        self._manager: Any = None
        self._free_s = 0.0

    def open(self) -> None:
        """Open the address.

        Raises:
            InputError: PyVISA is not installed, or the address is not a VISA address.
            LinkLostError: there is nothing to open.
        """
        settings = self._settings
        visa = _visa(settings.backend)
        self.close()
        try:
            self._manager = self._manager or visa.ResourceManager(f"@{settings.backend}")
            self._resource = self._manager.open_resource(settings.resource, open_timeout=1000)
        except Exception as error:  # the backend raises whatever its own parts raise, bare Exception among them
            raise _not_opened(settings.resource, error) from error
        resource = self._resource
        resource.timeout = 1000.0 * settings.timeout_s
        resource.write_termination, resource.read_termination = settings.write_end, settings.read_end
        if settings.is_serial:
            resource.baud_rate = settings.baud
        self._disable_nagle()

    def write(self, text: str) -> float:
        """Send a command; returns when its last byte was on the wire, as `time.perf_counter`."""
        self._wait_for_spacing()
        try:
            self._resource.write(text)
        except Exception as error:  # see `open`
            raise LinkLostError(f"{self._settings.resource}: {text} could not be sent ({_words(error)})") from error
        sent_s = time.perf_counter()
        if self._settings.is_serial:
            sent_s += (len(text) + len(self._settings.write_end)) * _BITS_PER_BYTE / self._settings.baud
        self._free_s = sent_s + self._settings.spacing_s
        return sent_s

    def query(self, text: str) -> str:
        """Send a question, return the answer without its end."""
        self.write(text)
        try:
            return self._resource.read()
        except Exception as error:  # see `open`
            if _is_timeout(error):
                raise NoReplyError(
                    f"{self._settings.resource}: no answer to {text} within {self._settings.timeout_s:g} s"
                ) from error
            raise LinkLostError(f"{self._settings.resource}: no answer to {text} ({_words(error)})") from error

    def drain(self) -> None:
        """Throw away what comes until nothing came for 30 ms, for at most a timeout."""
        resource = self._resource
        if resource is None:
            return
        limit_s = time.perf_counter() + self._settings.timeout_s
        with contextlib.suppress(Exception):
            resource.timeout = 1000.0 * _QUIET_S
            while time.perf_counter() < limit_s:
                resource.read()
        with contextlib.suppress(Exception):
            resource.timeout = 1000.0 * self._settings.timeout_s

    def close(self) -> None:
        """Close; a second call does nothing."""
        resource, self._resource = self._resource, None
        if resource is not None:
            with contextlib.suppress(Exception):
                resource.close()

    def _wait_for_spacing(self) -> None:
        if self._resource is None:
            raise LinkLostError(f"{self._settings.resource}: the link is closed")
        wait_s = self._free_s - time.perf_counter()
        if self._settings.spacing_s and wait_s > 0.0:
            time.sleep(wait_s)

    def _disable_nagle(self) -> None:
        # PyVISA-py keeps the socket in its session and offers no working attribute for this; other backends have
        # neither the session nor the problem
        with contextlib.suppress(AttributeError, KeyError, TypeError):
            interface = self._resource.visalib.sessions[self._resource.session].interface
            if isinstance(interface, socket.socket):
                interface.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def _visa(backend: str) -> Any:
    try:
        import pyvisa

        if backend == "py":
            import pyvisa_py  # noqa: F401
            import serial  # noqa: F401
    except ImportError as error:
        raise InputError(f"the bench needs {error.name}: pip install piezo-bender[bench]") from error
    return pyvisa


def _not_opened(resource: str, error: Exception) -> Exception:
    if type(error).__name__ == "VisaIOError" and "INV_RSRC_NAME" in str(error):
        return InputError(f"{resource}: is not a VISA address, expected one like TCPIP::192.168.1.7::5025::SOCKET")
    return LinkLostError(f"{resource}: cannot be opened ({_words(error)})")


def _is_timeout(error: Exception) -> bool:
    return type(error).__name__ == "VisaIOError" and "TMO" in str(error)


def _words(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
