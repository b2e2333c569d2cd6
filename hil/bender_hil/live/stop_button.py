"""`python -m bender_hil.live.stop_button`: the STOP button as a process of its own.

Plain HTTP on the loopback on one side, the guard's ear on the other, and nothing between: no page server, no runner, no
library. Its address holds a token; whoever does not know it sees nothing. It is told on its standard input where the
guard listens ("guard PORT", "guard -"), says on its standard output where it listens and when somebody pressed it, and
ends with its standard input.

`POST /TOKEN/stop` answers when the guard has answered, or after a second. `GET /TOKEN` is a page with nothing but the
button, for when the other page does not answer.
"""

import json
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from bender_hil.guard.stop_ear import LOOPBACK, say_stop

_PATIENCE_S = 1.0
_HOSTS = ("127.0.0.1", "localhost")
PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>STOP</title>
<meta name="viewport" content="width=device-width"><style>body{margin:0;font-family:sans-serif;text-align:center}
button{width:90vw;height:60vh;margin:5vh auto;font-size:18vw;background:#c01c28;color:#fff;border:0;border-radius:2vw}
</style><button id="stop">STOP</button><p id="said" role="status"></p><script>
const said = document.getElementById("said");
function stop() { said.textContent = "STOP is being said";
  const place = location.pathname.replace(/\\/$/, "") + "/stop";
  fetch(place, {method: "POST", signal: AbortSignal.timeout(2500)}).then(x => x.json())
    .then(x => { said.textContent = x.said; })
    .catch(() => { said.textContent = "no answer: press OUTPUT OFF at the source"; }); }
document.getElementById("stop").onclick = stop;
document.onkeydown = e => { if (e.code === "Space") { e.preventDefault(); stop(); } };
</script></html>"""


class Button:
    """What the button knows: the token of the guard, and where it listens.

    Args:
        token: that the guard has to hear, and that the address has to hold.
    """

    def __init__(self, token: str) -> None:
        self.token = token
        self.guard_port: int | None = None
        self.pressed = 0

    def press(self) -> dict[str, object]:
        """Say STOP until the guard answers; returns what came of it."""
        self.pressed += 1
        _tell({"pressed": self.pressed})
        start_s = time.perf_counter()
        while time.perf_counter() - start_s < _PATIENCE_S:
            port = self.guard_port
            if port is None:
                return {"heard": False, "said": "no output is on; nothing more will be played"}
            if say_stop(port, self.token):
                after_ms = 1e3 * (time.perf_counter() - start_s)
                return {"heard": True, "after_ms": after_ms, "said": "the guard has heard STOP and brings it down"}
        return {"heard": False, "said": "the guard does not answer: press OUTPUT OFF at the source"}


def server(button: Button) -> ThreadingHTTPServer:
    """Return the button's server on a free port of the loopback."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        timeout = 5.0

        def do_GET(self) -> None:
            """Show the button."""
            if self._is_asked_for(""):
                self._answer(200, PAGE.encode(), "text/html; charset=utf-8")

        def do_POST(self) -> None:
            """Press it."""
            if self._is_asked_for("/stop"):
                self._answer(200, json.dumps(button.press()).encode(), "application/json")

        def log_message(self, format: str, *args: object) -> None:
            """Keep quiet: the address holds the token."""

        def _is_asked_for(self, what: str) -> bool:
            path = self.path.partition("?")[0].rstrip("/")
            host = (self.headers.get("Host") or "").rpartition(":")[0]
            if path == f"/{button.token}{what}" and host in _HOSTS:
                return True
            self._answer(404, b"not found", "text/plain")
            return False

        def _answer(self, status: int, body: bytes, kind: str) -> None:
            self.close_connection = True
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            # the page with the charts is served from another port
            self.send_header("Access-Control-Allow-Origin", "*")
            self.send_header("Connection", "close")
            self.end_headers()
            self.wfile.write(body)

    made = ThreadingHTTPServer((LOOPBACK, 0), Handler)
    made.daemon_threads = True
    return made


def main() -> int:
    """Serve until the standard input ends."""
    button = Button(sys.stdin.readline().strip())
    serving = server(button)
    threading.Thread(target=serving.serve_forever, daemon=True).start()
    _tell({"port": serving.server_address[1]})
    for line in sys.stdin:
        word, _, value = line.strip().partition(" ")
        if word == "guard":
            button.guard_port = int(value) if value.isdigit() else None
    return 0


def _tell(message: dict[str, object]) -> None:
    try:
        sys.stdout.write(json.dumps(message) + "\n")
        sys.stdout.flush()
    except OSError:  # whoever listened has gone; the guard is still told
        pass


if __name__ == "__main__":
    import signal

    # what is typed at the terminal is not for this process; it ends with whoever started it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.exit(main())
