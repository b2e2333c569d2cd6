"""Bytes out, bytes in, below PyVISA's messages.

PyVISA's pure Python backend counts its timeout anew with every byte that comes, loses what came before a timeout, and
waits for ever to write. A link that has to keep deadlines reads and writes the backend's socket or serial port itself.
Another backend keeps its own deadlines; its messages are taken whole.
"""

import socket
from typing import Any, Protocol

_AT_ONCE = 4096


class Stream(Protocol):
    """An open connection; any exception means that it is lost."""

    def send(self, data: bytes, timeout_s: float) -> None:
        """Send all of it within `timeout_s`."""
        ...

    def some(self, timeout_s: float) -> bytes:
        """Return what comes first within `timeout_s`; nothing when nothing came."""
        ...


class SocketStream:
    """A TCP connection."""

    def __init__(self, stream: socket.socket) -> None:
        stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._stream = stream

    def send(self, data: bytes, timeout_s: float) -> None:
        """Send all of it within `timeout_s`."""
        self._stream.settimeout(timeout_s)
        self._stream.sendall(data)

    def some(self, timeout_s: float) -> bytes:
        """Return what comes first within `timeout_s`."""
        self._stream.settimeout(timeout_s)
        try:
            data = self._stream.recv(_AT_ONCE)
        except (TimeoutError, BlockingIOError):
            return b""
        if not data:
            raise ConnectionError("the instrument has closed the connection")
        return data


class SerialStream:
    """A serial port of pyserial.

    Args:
        port: open.
        slice_s: longest wait for a first byte; setting it again costs system calls.
        timeout_s: longest wait of a write.
    """

    def __init__(self, port: Any, slice_s: float, timeout_s: float) -> None:
        self._port = port
        port.timeout, port.write_timeout = slice_s, timeout_s

    def send(self, data: bytes, timeout_s: float) -> None:  # noqa: ARG002
        """Hand all of it to the port."""
        self._port.write(data)

    def some(self, timeout_s: float) -> bytes:  # noqa: ARG002
        """Return what comes first within a slice."""
        return self._port.read(max(1, min(self._port.in_waiting, _AT_ONCE)))


class MessageStream:
    """A resource of a backend that keeps its own deadlines."""

    def __init__(self, resource: Any) -> None:
        self._resource = resource

    def send(self, data: bytes, timeout_s: float) -> None:
        """Send all of it within `timeout_s`."""
        self._resource.timeout = 1000.0 * max(timeout_s, 0.001)
        self._resource.write_raw(data)

    def some(self, timeout_s: float) -> bytes:
        """Return the message that comes within `timeout_s`."""
        self._resource.timeout = 1000.0 * max(timeout_s, 0.001)
        try:
            return self._resource.read_raw()
        except Exception as error:
            if type(error).__name__ == "VisaIOError" and "TMO" in str(error):
                return b""
            raise


def stream_of(resource: Any, slice_s: float, timeout_s: float) -> Stream:
    """Return the stream below an open PyVISA resource."""
    sessions = getattr(resource.visalib, "sessions", {})
    interface = getattr(sessions.get(resource.session), "interface", None) if isinstance(sessions, dict) else None
    if isinstance(interface, socket.socket):
        return SocketStream(interface)
    if hasattr(interface, "in_waiting"):
        return SerialStream(interface, slice_s, timeout_s)
    return MessageStream(resource)
