"""The guard's ear for STOP: one datagram on the loopback that holds the right token brings the output down.

It belongs to the guard, so no page, no server and no controller stands between a person's hand and the way down. It
never waits: a look at it costs some microseconds, and what is not the token is dropped.
"""

import contextlib
import hmac
import socket

from bender_loop.shell.closed_at_exit import ClosedAtExit

LOOPBACK = "127.0.0.1"
HEARD = b"heard"
_LONGEST_BYTES = 256
_MOST_AT_ONCE = 20


class StopEar(ClosedAtExit):
    """A socket that hears STOP.

    Args:
        token: that a datagram has to hold; 16 signs at least.

    Attributes:
        port: where it listens.

    Raises:
        OSError: no socket can be made.
        ValueError: the token is too short to keep a secret.
    """

    def __init__(self, token: str) -> None:
        if len(token) < 16:
            raise ValueError(f"token must have at least 16 signs, found {len(token)}")
        self._token = token.encode()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((LOOPBACK, 0))
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]

    def heard(self) -> bool:
        """Whether somebody has said STOP; whoever did is answered. Never waits, never raises."""
        for _ in range(_MOST_AT_ONCE):
            try:
                data, sender = self._socket.recvfrom(_LONGEST_BYTES)
            except OSError:
                return False
            if hmac.compare_digest(data, self._token):
                with contextlib.suppress(OSError):
                    self._socket.sendto(HEARD, sender)
                return True
        return False

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()


def say_stop(port: int, token: str, wait_s: float = 0.05) -> bool:
    """Say STOP to a guard once; returns whether it answered within `wait_s`."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mouth:
        mouth.settimeout(wait_s)
        try:
            mouth.connect((LOOPBACK, port))
            mouth.send(token.encode())
            return mouth.recv(_LONGEST_BYTES) == HEARD
        except OSError:
            return False
