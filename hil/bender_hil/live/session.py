"""Both processes of the page, started beside a run, and what the runner tells them.

The STOP button comes first: it serves before anything is armed, and goes on serving whatever becomes of the page.
"""

import contextlib
import json
import secrets
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

from bender_hil.guard.stop_ear import LOOPBACK
from bender_hil.live.frame_board import FrameWriter
from bender_hil.runner.tip_camera import Sight
from bender_loop.errors import InputError, RunError
from bender_loop.shell.closed_at_exit import ClosedAtExit
from bender_loop.shell.process_group import own_group

BUTTON_GONE = "bender: the process of the STOP button has gone: STOP on the page does nothing, Ctrl-C here does\n"
_LEAVE_S = 3.0


class LiveSession(ClosedAtExit):
    """A page for one run, one investigation or one past run; a context manager that ends both processes.

    Args:
        folder: of the run, or of the investigation.
        is_replay: whether it is over: then there is no STOP.

    Attributes:
        token: that the address holds, and that the guard has to hear.
        url: of the page.
        stop_url: of the button; "" for a replay.

    Raises:
        InputError: NiceGUI is not installed.
        RunError: a process does not start.
    """

    def __init__(self, folder: Path, *, is_replay: bool = False) -> None:
        self.token = secrets.token_hex(16)
        self.stop_url = ""
        self._ends = contextlib.ExitStack()
        self._asked, self._closing = threading.Event(), threading.Event()
        self._button: subprocess.Popen[str] | None = None
        self._writer: FrameWriter | None = None
        try:
            board = None
            if not is_replay:
                place = self._ends.enter_context(
                    tempfile.TemporaryDirectory(prefix="bender-live-", ignore_cleanup_errors=True)
                )
                board = Path(place) / "frame"
                self._writer = FrameWriter(board)
                self._ends.callback(self._writer.close)
                self._start_button()
            self.url = self._start_page(folder.absolute(), board, is_replay)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End both processes."""
        self._closing.set()
        self._ends.close()

    @property
    def stop_asked(self) -> bool:
        """Whether somebody has pressed STOP, whatever was on at that time."""
        return self._asked.is_set()

    def armed(self, port: int | None) -> None:
        """Tell the button where the guard listens; None when it does not any more."""
        if self._button is not None and self._button.stdin is not None:
            with contextlib.suppress(OSError, ValueError):
                self._button.stdin.write(f"guard {'-' if port is None else port}\n")
                self._button.stdin.flush()

    def see(self, sight: Sight) -> None:
        """Show a frame; nothing that fails here reaches the run."""
        if self._writer is not None and sight.image is not None:
            with contextlib.suppress(OSError, ValueError):
                self._writer.publish(sight.number, sight.grabbed_s, sight.tip_um, sight.tip_px, sight.image)

    def _start_button(self) -> None:
        button = self._process("bender_hil.live.stop_button", self.token)
        told = self._first_word(button, "the STOP button")
        self._button = button
        self.stop_url = f"http://{LOOPBACK}:{told['port']}/{self.token}/stop"
        threading.Thread(target=self._hear_button, args=(button,), daemon=True).start()

    def _start_page(self, folder: Path, board: Path | None, is_replay: bool) -> str:
        words = {
            "folder": str(folder),
            "board": None if board is None else str(board),
            "stop_url": self.stop_url,
            "token": self.token,
            "replay": is_replay,
        }
        page = self._process("bender_hil.live.page_server", json.dumps(words))
        self.page_pid = page.pid
        told = self._first_word(page, "the page")
        if "failed" in told:
            raise InputError(str(told["failed"]))
        return f"http://{LOOPBACK}:{told['port']}/?token={self.token}"

    def _process(self, module: str, line: str) -> "subprocess.Popen[str]":
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            **own_group(),
        )
        self._ends.callback(_end, process)
        if process.stdin is not None:
            process.stdin.write(line + "\n")
            process.stdin.flush()
        return process

    def _first_word(self, process: "subprocess.Popen[str]", who: str) -> dict[str, Any]:
        line = process.stdout.readline() if process.stdout is not None else ""
        if not line:
            raise RunError(f"{who} does not start; see its message above")
        return json.loads(line)

    def _hear_button(self, button: "subprocess.Popen[str]") -> None:
        for line in button.stdout or ():
            if "pressed" in line:
                self._asked.set()
        if not self._closing.is_set():
            with contextlib.suppress(OSError):
                sys.stderr.write(BUTTON_GONE)
                sys.stderr.flush()


def _end(process: "subprocess.Popen[str]") -> None:
    if process.stdin is not None:
        with contextlib.suppress(OSError):
            process.stdin.close()
    try:
        process.wait(timeout=_LEAVE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdout is not None:
        with contextlib.suppress(OSError):
            process.stdout.close()
