"""Messages between the processes of a bench: lines of JSON over a loopback socket.

The end of a process, however it comes, closes its sockets: the other side then meets `ClosedError` at once, which is
what makes `kill -9` of the controller visible without any waiting.
"""

import contextlib
import json
import secrets
import select
import socket
import time
from typing import Any

from bender_loop.shell.closed_at_exit import ClosedAtExit

Message = dict[str, Any]
LOOPBACK = "127.0.0.1"
_LARGEST_BYTES = 1 << 24


class ClosedError(Exception):
    """The other side has gone, or does not speak this language."""


class Channel(ClosedAtExit):
    """Messages both ways over a connected stream socket."""

    def __init__(self, stream: socket.socket) -> None:
        stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        stream.setblocking(True)
        self._stream = stream
        self._buffer = bytearray()

    def send(self, message: Message) -> None:
        """Send one message; ClosedError when nobody is there."""
        try:
            self._stream.sendall(json.dumps(message, allow_nan=False).encode() + b"\n")
        except OSError as error:
            raise ClosedError(str(error)) from error

    def receive(self, timeout_s: float) -> Message | None:
        """The next message, None when there is none within `timeout_s`; ClosedError when there will be none."""
        limit_s = time.perf_counter() + timeout_s
        while (end := self._buffer.find(b"\n")) < 0:
            wait_s = max(0.0, limit_s - time.perf_counter())
            try:
                ready, _, _ = select.select([self._stream], [], [], wait_s)
                if not ready:
                    return None
                data = self._stream.recv(65536)
            except (OSError, ValueError) as error:
                raise ClosedError(str(error)) from error
            if not data or len(self._buffer) > _LARGEST_BYTES:
                raise ClosedError("the other side has gone")
            self._buffer += data
        line = bytes(self._buffer[:end])
        del self._buffer[: end + 1]
        return _decoded(line)

    def ask(self, message: Message, timeout_s: float = 5.0) -> Message:
        """Send a message and wait for the next one.

        Raises:
            ClosedError: the other side has gone, or says nothing in time.
        """
        self.send(message)
        answer = self.receive(timeout_s)
        if answer is None:
            raise ClosedError(f"no answer to {message!r} within {timeout_s:g} s")
        return answer

    def has_message(self) -> bool:
        """Whether `receive` would find something at once; also true when the other side has gone."""
        if b"\n" in self._buffer:
            return True
        try:
            return bool(select.select([self._stream], [], [], 0.0)[0])
        except (OSError, ValueError):
            return True

    def close(self) -> None:
        """Close; a second call does nothing."""
        with contextlib.suppress(OSError):
            self._stream.close()


class Listener:
    """Waits for the one process that knows the password."""

    def __init__(self) -> None:
        self._socket = socket.create_server((LOOPBACK, 0))
        self.port: int = self._socket.getsockname()[1]
        self.password = secrets.token_hex(16)

    def accept(self, timeout_s: float) -> Channel:
        """The channel to whoever presents the password first.

        Raises:
            ClosedError: nobody did within `timeout_s`.
        """
        limit_s = time.perf_counter() + timeout_s
        while (left_s := limit_s - time.perf_counter()) > 0.0:
            self._socket.settimeout(left_s)
            try:
                stream, _ = self._socket.accept()
            except TimeoutError:
                break
            channel = Channel(stream)
            with contextlib.suppress(ClosedError):
                greeting = channel.receive(1.0)
                if greeting is not None and greeting.get("password") == self.password:
                    return channel
            channel.close()
        raise ClosedError(f"nobody called within {timeout_s:g} s")

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()


def call(port: int, password: str) -> Channel:
    """The channel to a listener on this machine; ClosedError when nobody listens."""
    try:
        channel = Channel(socket.create_connection((LOOPBACK, port), timeout=5.0))
    except OSError as error:
        raise ClosedError(str(error)) from error
    channel.send({"password": password})
    return channel


def _decoded(line: bytes) -> Message:
    try:
        message = json.loads(line)
    except ValueError as error:
        raise ClosedError(f"found {line[:80]!r}, expected a line of JSON") from error
    if not isinstance(message, dict):
        raise ClosedError(f"found {line[:80]!r}, expected an object")
    return message
