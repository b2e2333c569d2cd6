"""The wire by which faults are switched on from outside: one line asks, one line answers.

stall 2.5        for 2.5 s; without a number until `clear`
clear            everything off
status           counts and what is on, as JSON
"""

import contextlib
import json
import math
import socket
import threading
from types import TracebackType
from typing import Self

from bender_emulator.microscope.server import LOOPBACK, FrameServer

_PATIENCE_S, _ANSWER_S = 0.2, 2.0
_LONGEST_LINE = 200


class ControlServer:
    """Answers lines on a loopback port, one client after another.

    Args:
        server: whose faults are switched.
        port: to listen on; 0 takes a free one.

    Raises:
        OSError: the port is taken.
    """

    def __init__(self, server: FrameServer, port: int = 0) -> None:
        self._server = server
        self._listener = socket.create_server((LOOPBACK, port))
        self._listener.settimeout(_PATIENCE_S)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="microscope control", daemon=True)

    @property
    def port(self) -> int:
        """Where it listens."""
        return self._listener.getsockname()[1]

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.set()
        self._thread.join()
        self._listener.close()

    def _serve(self) -> None:
        while not self._closing.is_set():
            with contextlib.suppress(OSError):
                client, _ = self._listener.accept()
                with client:
                    client.settimeout(_PATIENCE_S)
                    self._talk(client)

    def _talk(self, client: socket.socket) -> None:
        pending = b""
        while not self._closing.is_set():
            try:
                data = client.recv(_LONGEST_LINE)
            except TimeoutError:
                continue
            if not data:
                return
            pending += data
            while b"\n" in pending:
                line, pending = pending.split(b"\n", 1)
                client.sendall(f"{self._answer(line.decode('ascii', 'replace'))}\n".encode())
            if len(pending) > _LONGEST_LINE:
                return

    def _answer(self, line: str) -> str:
        words = line.split()
        if words == ["clear"]:
            self._server.faults.clear()
            return "ok"
        if words == ["status"]:
            return json.dumps(self._server.status())
        if not 1 <= len(words) <= 2:
            return f"error: found {line!r}, expected a fault and seconds, clear, or status"
        try:
            self._server.faults.set(words[0], float(words[1]) if len(words) == 2 else math.inf)
        except ValueError as error:
            return f"error: {error}"
        return "ok"


def ask_microscope(port: int, line: str) -> str:
    """Send one line to a control port at loopback and return the answer.

    Raises:
        OSError: nobody answers there.
        ValueError: the answer is an error.
    """
    with socket.create_connection((LOOPBACK, port), _ANSWER_S) as link:
        link.sendall(line.encode("ascii") + b"\n")
        with link.makefile("r", encoding="ascii") as lines:
            answer = lines.readline().strip()
    if not answer:
        raise ConnectionError(f"microscope control at port {port}: hung up without an answer")
    if answer.startswith("error: "):
        raise ValueError(answer.removeprefix("error: "))
    return answer


def set_fault(port: int, name: str, duration_s: float | None = None) -> None:
    """Switch a fault of `bender_emulator.microscope.faults` on, for a while or until `clear_faults`.

    Raises:
        OSError: nobody answers there.
        ValueError: there is no such fault.
    """
    ask_microscope(port, name if duration_s is None else f"{name} {duration_s!r}")


def clear_faults(port: int) -> None:
    """Switch every fault off.

    Raises:
        OSError: nobody answers there.
    """
    ask_microscope(port, "clear")
