"""The emulated supply's two sockets: a TCP port, and a pseudo-terminal that takes its time as a serial line does."""

import contextlib
import os
import select
import socket
import threading
import time
from pathlib import Path

from bender_emulator.conversation import Answering, Conversation, Hangup
from bender_loop.shell.messages import LOOPBACK

_BITS_PER_BYTE = 10


class _SocketWire:
    def __init__(self, stream: socket.socket) -> None:
        self._stream = stream

    def send(self, data: bytes) -> None:
        self._stream.sendall(data)


class TcpServer:
    """Serves one client at a time, as a supply's network port does; a second one is turned away.

    Args:
        instrument: who answers.
        end: what ends an answer.
        port: to listen on, at loopback; 0 takes a free one.

    Raises:
        OSError: the port is taken.
    """

    def __init__(self, instrument: Answering, end: str, port: int = 0) -> None:
        self._instrument, self._end = instrument, end
        self._listener = socket.create_server((LOOPBACK, port))
        self.port: int = self._listener.getsockname()[1]
        self._lock = threading.Lock()
        self._client: socket.socket | None = None
        threading.Thread(target=self._accept, daemon=True).start()

    def is_busy(self) -> bool:
        """Whether somebody is connected."""
        return self._client is not None

    def drop(self) -> None:
        """Break the connection that there is."""
        with self._lock:
            client = self._client
        if client is not None:
            with contextlib.suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close the port and the connection."""
        self.drop()
        self._listener.close()

    def _accept(self) -> None:
        while True:
            try:
                stream, _ = self._listener.accept()
            except OSError:
                return
            with self._lock:
                is_free = self._client is None and not self._instrument.faults.refuse
                if is_free:
                    self._client = stream
            if is_free:
                threading.Thread(target=self._serve, args=(stream,), daemon=True).start()
            else:
                stream.close()

    def _serve(self, stream: socket.socket) -> None:
        stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        conversation = Conversation(self._instrument, _SocketWire(stream), self._end)
        with contextlib.suppress(OSError, Hangup):
            while data := stream.recv(4096):
                conversation.feed(data)
        with self._lock:
            self._client = None
        stream.close()


class PtyServer:
    """A pseudo-terminal whose bytes take as long as on a line of `baud`; POSIX only.

    Args:
        instrument: who answers.
        end: what ends an answer.
        baud: speed that is kept to both ways.
        path: a link of this name leads to the terminal, also after the line was cut and made anew.
    """

    def __init__(self, instrument: Answering, end: str, baud: int, path: Path) -> None:
        self._instrument, self._end, self._baud, self.path = instrument, end, baud, path
        self._lock = threading.Lock()
        self._closed = False
        self._heard_s = 0.0
        self._open()
        threading.Thread(target=self._serve, daemon=True).start()

    def send(self, data: bytes) -> None:
        """Send an answer as slowly as the line is."""
        time.sleep(len(data) * _BITS_PER_BYTE / self._baud)
        os.write(self._near, data)

    def is_busy(self) -> bool:
        """Whether something came within the last second."""
        return time.perf_counter() - self._heard_s < 1.0

    def drop(self) -> None:
        """Cut the line; a new terminal is there at once under the same name."""
        with self._lock:
            near, far = self._near, self._far
            self._open()
        os.close(far)
        os.close(near)

    def close(self) -> None:
        """Cut the line for good."""
        self._closed = True
        self.path.unlink(missing_ok=True)

    def _open(self) -> None:
        # pseudo-terminals do not exist everywhere; whoever asks for one where they do not has been told before
        import pty
        import tty

        self._near, self._far = pty.openpty()
        tty.setraw(self._far)
        fresh = self.path.with_suffix(".new")
        fresh.unlink(missing_ok=True)
        fresh.symlink_to(os.ttyname(self._far))
        os.replace(fresh, self.path)

    def _serve(self) -> None:
        line = -1
        conversation = Conversation(self._instrument, self, self._end)
        while not self._closed:
            with self._lock:
                near = self._near
            if near != line:
                line, conversation = near, Conversation(self._instrument, self, self._end)
            with contextlib.suppress(OSError, ValueError, Hangup):
                ready, _, _ = select.select([near], [], [], 0.1)
                if ready:
                    data = os.read(near, 4096)
                    self._heard_s = time.perf_counter()
                    time.sleep(len(data) * _BITS_PER_BYTE / self._baud)
                    conversation.feed(data)
