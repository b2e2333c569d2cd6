"""An emulated controller that sends a line of text many times a second to whoever is connected."""

import contextlib
import math
import socket
import threading
import time

from bender_emulator.sensors.transducer import Transducer
from bender_loop.shell.messages import LOOPBACK


class TextStream:
    """Serves one client at a time.

    Args:
        transducer: what it says.

    Attributes:
        port: at loopback.
    """

    def __init__(self, transducer: Transducer) -> None:
        self._transducer = transducer
        self._listener = socket.create_server((LOOPBACK, 0))
        self.port: int = self._listener.getsockname()[1]
        self._client: socket.socket | None = None
        self._closed = False
        threading.Thread(target=self._accept, daemon=True).start()
        threading.Thread(target=self._serve, daemon=True).start()

    def is_busy(self) -> bool:
        """Whether somebody is connected."""
        return self._client is not None

    def drop(self) -> None:
        """Break the connection that there is."""
        client, self._client = self._client, None
        if client is not None:
            with contextlib.suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)
                client.close()

    def close(self) -> None:
        """Close the port and the connection."""
        self._closed = True
        self.drop()
        self._listener.close()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            if self._transducer.faults.refuse:
                client.close()
                continue
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client.settimeout(0.5)
            self.drop()
            self._client = client

    def _serve(self) -> None:
        period_s = 1.0 / self._transducer.settings.rate_Hz
        due_s = time.perf_counter()
        while not self._closed:
            due_s = max(due_s + period_s, time.perf_counter() - period_s)
            time.sleep(max(0.0, due_s - time.perf_counter()))
            client = self._client
            if client is None or self._transducer.faults.hung:
                continue
            try:
                client.sendall(self._line())
            except OSError:
                self.drop()

    def _line(self) -> bytes:
        with self._transducer.lock:
            faults = self._transducer.faults
            is_garbled = faults.garble > 0
            if is_garbled:
                self._transducer.faults = faults.with_fault("garble", faults.garble - 1)
        value_um = self._transducer.reading_um() + self._transducer.settings.zero_um
        text = faults.reading_V or (f"{value_um:.4f}" if math.isfinite(value_um) else "OUT OF RANGE")
        line = f"{text} um\r\n".encode("ascii", "replace")
        if faults.no_end:
            line = line.removesuffix(b"\r\n")
        return bytes(byte ^ 0x40 for byte in line[:-2]) + line[-2:] if is_garbled else line
