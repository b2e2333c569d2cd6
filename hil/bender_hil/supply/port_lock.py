"""One controller per serial line: a lock that is taken before the port is touched.

Opening a serial port sets its speed and throws away what is owed to whoever had it open, so a second controller would
spoil a run before it noticed. The lock is the operating system's: it goes with the process that holds it.
"""

import os
import sys

from bender_hil.supply.failures import LinkLostError


class PortLock:
    """A lock on a serial port; Windows opens such a port once only and needs none.

    Args:
        path: of the port.

    Raises:
        LinkLostError: another process holds it, or the port cannot be opened.
    """

    def __init__(self, path: str) -> None:
        self._file = -1
        if sys.platform == "win32":
            return
        import fcntl

        try:
            self._file = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            raise LinkLostError(f"{path}: cannot be opened ({error.strerror})") from error
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self.release()
            raise LinkLostError(f"{path}: another process has this port open and drives what is behind it") from error

    def release(self) -> None:
        """Give it back; a second call does nothing."""
        file, self._file = self._file, -1
        if file >= 0:
            os.close(file)
