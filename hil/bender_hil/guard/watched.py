"""The controller's side of the watchman: start it, and tell it that the run is over."""

import contextlib
import json
import os
import subprocess
import sys
from typing import Any

from bender_hil.guard.settings import GuardOrders
from bender_loop.errors import RunError
from bender_loop.shell.process_group import own_group

_LEAVE_S = 1.0


class Watchman:
    """A watchman in a process of its own; it sees the end of this one by the pipe that this one holds.

    Args:
        orders: of the guard that it watches.

    Attributes:
        port, password: where guards call it.

    Raises:
        RunError: it does not start.
    """

    def __init__(self, orders: GuardOrders) -> None:
        words = [sys.executable, "-P", "-m", "bender_hil.guard.watchman"]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(words, stdin=pipe, stdout=pipe, text=True, **own_group())
        self._line = -1
        told = self._started(orders)
        self.port: int = told["port"]
        self.password: str = told["password"]

    def dismiss(self) -> None:
        """Say that the last word on the output has been said."""
        with contextlib.suppress(OSError):
            os.write(self._line, b"done\n")
        self._let_go()
        try:
            self._process.wait(timeout=_LEAVE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def hand_over(self, limit_s: float) -> None:
        """Leave the output to the watchman, as no guard could be started from here; waits so long for what it says.

        One that takes longer is left to it: it may be about to switch off.
        """
        self._let_go()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=limit_s)

    def _let_go(self) -> None:
        line, self._line = self._line, -1
        with contextlib.suppress(OSError):
            os.close(line)

    def _started(self, orders: GuardOrders) -> dict[str, Any]:
        stdin, stdout = self._process.stdin, self._process.stdout
        line = ""
        if stdin is not None and stdout is not None:
            with contextlib.suppress(OSError), stdout, stdin:
                # held for as long as this process lives, whatever becomes of this object
                self._line = os.dup(stdin.fileno())
                stdin.write(orders.to_json() + "\n")
                stdin.flush()
                line = stdout.readline()
        if not line:
            self.dismiss()
            raise RunError("the process that watches controller and guard does not start; see its message above")
        return json.loads(line)
