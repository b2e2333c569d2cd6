"""`python -m bender_hil.live.page_server`: the page's process.

It is told in one line of JSON on its standard input what to show, says in one line on its standard output that it
serves, and ends with its standard input, once the browsers have seen the end of the run. Nobody waits long for it.
"""

import json
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from bender_hil.guard.stop_ear import LOOPBACK
from bender_loop.shell.extras import install_command

if TYPE_CHECKING:
    from bender_hil.live.page import Shown

RECONNECT_S = 60.0
"""A page whose connection is slower than this loads itself anew; on a busy machine it would do so again and again."""
_LAST_WORD_S, _DRAW_S, _SEND_S = 90.0, 2.0, 0.3
"""For the guard of a lost controller to say how it ended; for every browser to draw that; for it to get there."""


def main() -> int:
    """Serve the page until the standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    line = sys.stdin.readline()
    if not line:
        return 1
    told = json.loads(line)
    try:
        from nicegui import app, ui
    except ImportError as error:
        _tell({"failed": f"NiceGUI cannot be imported ({error}); install it with: {install_command('live')}"})
        return 1
    from bender_hil.live.page import Shown, build
    from bender_hil.live.token_gate import TokenGate

    port = _free_port()
    board = None if told["board"] is None else Path(told["board"])
    shown = Shown(Path(told["folder"]), board, told["stop_url"], is_replay=told["replay"])
    build(shown)
    app.add_middleware(TokenGate, token=told["token"], port=port)
    app.on_startup(lambda: _tell({"port": port}))
    threading.Thread(target=_end_with_input, args=(shown,), daemon=True).start()
    ui.run(
        host=LOOPBACK,
        port=port,
        show=False,
        reload=False,
        show_welcome_message=False,
        uvicorn_logging_level="error",
        reconnect_timeout=RECONNECT_S,
    )
    return 0


def _end_with_input(shown: "Shown") -> None:
    """End with whoever started this process, however that went; but not before every browser has seen how it ended."""
    sys.stdin.read()
    if not shown.is_replay and _browsers():
        # a guard may come down for longer than its controller lives
        _wait(lambda: shown.is_settled or not _browsers(), _LAST_WORD_S)
        shown.is_closing = True
        _wait(lambda: shown.redrawn >= _browsers(), _DRAW_S)
        time.sleep(_SEND_S)
    os._exit(0)


def _browsers() -> int:
    """Return how many browsers show the page."""
    from nicegui import app

    return sum(client.has_socket_connection for client in list(app.clients("/")))


def _wait(condition: Callable[[], bool], limit_s: float) -> None:
    end_s = time.monotonic() + limit_s
    while time.monotonic() < end_s and not condition():
        time.sleep(0.05)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def _tell(message: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(message) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
