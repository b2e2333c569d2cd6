"""`python -m bender_hil.live.page_server`: the page's process.

It is told in one line of JSON on its standard input what to show, says in one line on its standard output that it
serves, and ends with its standard input. Nobody waits for it.
"""

import json
import os
import signal
import socket
import sys
import threading
from pathlib import Path

from bender_hil.guard.stop_ear import LOOPBACK
from bender_loop.shell.extras import install_command

RECONNECT_S = 60.0
"""A page whose connection is slower than this loads itself anew; on a busy machine it would do so again and again."""


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
    build(Shown(Path(told["folder"]), board, told["stop_url"], is_replay=told["replay"]))
    app.add_middleware(TokenGate, token=told["token"], port=port)
    app.on_startup(lambda: _tell({"port": port}))
    threading.Thread(target=_end_with_input, daemon=True).start()
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


def _end_with_input() -> None:
    """Whoever started this process has gone, however it went: there is nothing to show any more."""
    sys.stdin.read()
    os._exit(0)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def _tell(message: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(message) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
