"""The page in a real browser: Chromium, driven by Playwright, on a run of the emulated bench."""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from present import present

from bender_hil.live import stop_button
from bender_hil.log.read_run import read_run

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PATIENT = "[emulator]\n[guard]\nheartbeat_s = 5.0\nframe_age_s = 5.0\n"
"""Nothing real is at stake, and the machine may be busy."""
OUTSIDE = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
"""NiceGUI would take the run for a test of its own."""
pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(280),
    pytest.mark.skipif(sys.platform == "win32" or CHROMIUM is None, reason="needs Chromium and POSIX signals"),
]


@contextlib.contextmanager
def watched_run(folder: Path, more: str = "") -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A run that is watched, and the address of its page."""
    (folder / "bench.toml").write_text(PATIENT + more)
    words = [sys.executable, "-m", "bender_cli", "hil", "--bench", "bench.toml", "--watch", "--duration", "120"]
    run = subprocess.Popen([*words, "--out", "run"], cwd=folder, env=OUTSIDE, stdout=subprocess.PIPE, text=True)
    try:
        assert run.stdout is not None
        address = next(found.group(1) for line in run.stdout if (found := re.match(r"watch: (\S+)", line)))
        yield run, address
    finally:
        if run.poll() is None:
            run.send_signal(signal.SIGINT)
            run.communicate(timeout=60.0)


@contextlib.contextmanager
def browser() -> Iterator:
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


def _page_server(run: int) -> int:
    """The process id of the page's server among the children of a run."""
    found = subprocess.run(["ps", "-eo", "pid,ppid,args"], capture_output=True, text=True, check=True).stdout
    lines = [line.split(None, 2) for line in found.splitlines()]
    return next(int(pid) for pid, parent, words in lines if parent == str(run) and "page_server" in words)


@contextlib.contextmanager
def hanging_button(script: str) -> Iterator[str]:
    """The address of a page whose STOP goes to a process that takes the request and never answers."""
    url = ""
    is_over = threading.Event()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            told = f'window.benderLive = {{stopUrl: "{url}/stop"}};'
            own = f'<p id="stop-said"></p><button id="stop">STOP</button><script>{told}{script}</script>'
            page = own if script else stop_button.PAGE
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.end_headers()
            self.wfile.write(page.encode())

        def do_POST(self) -> None:
            is_over.wait(60.0)

        def log_message(self, format: str, *args: object) -> None:
            """Keep quiet."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    url = f"http://127.0.0.1:{server.server_address[1]}"
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield url
    finally:
        is_over.set()
        server.shutdown()
        server.server_close()


@pytest.mark.parametrize("file", ["", "page.js"])
def test_a_button_that_hangs_is_said_to_give_no_answer(file: str):
    script = Path(stop_button.__file__).with_name(file).read_text(encoding="utf-8") if file else ""
    with hanging_button(script) as address, browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        page.keyboard.press("Space")
        page.wait_for_function("document.body.innerText.includes('STOP is being said')", timeout=10_000)
        page.wait_for_function("document.body.innerText.includes('press OUTPUT OFF at the source')", timeout=20_000)


def test_stop_by_the_space_bar_while_the_pages_server_hangs(tmp_path):
    with watched_run(tmp_path) as (run, address), browser() as chromium:
        page = chromium.new_page(viewport={"width": 1280, "height": 900})
        assert page.goto(address).status == 200
        page.wait_for_function("window.framesShown > 10", timeout=90_000)
        page.wait_for_function("document.body.innerText.includes('armed')", timeout=90_000)
        assert page.locator("canvas").count() >= 3
        narrow = chromium.new_page(viewport={"width": 400, "height": 850})
        narrow.goto(address)
        narrow.wait_for_function("window.framesShown > 3", timeout=90_000)
        assert narrow.evaluate("document.documentElement.scrollWidth") <= 400
        _nobody_else_sees_anything(address, chromium)

        server = _page_server(run.pid)
        os.kill(server, signal.SIGSTOP)
        try:
            page.keyboard.press("Space")
            page.wait_for_function(
                "document.getElementById('stop-said').textContent.includes('the guard has heard STOP')", timeout=60_000
            )
            rest, _ = run.communicate(timeout=60.0)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.kill(server, signal.SIGCONT)
    assert run.returncode == 1
    assert "STOP was pressed" in rest
    log = read_run(tmp_path / "run")
    end = present(log.guard_entry("end"))
    assert end["confirmed"] is True
    assert end["code"] == "stop"


def test_after_stop_the_page_shows_the_way_down_and_stays_as_the_run_ended(tmp_path):
    with watched_run(tmp_path, "ramp_V_per_s = 25.0\n") as (run, address), browser() as chromium:
        page = chromium.new_page(viewport={"width": 1280, "height": 900})
        page.goto(address)
        page.wait_for_function("window.framesShown > 30", timeout=90_000)
        page.wait_for_function("/command\\s+(1[0-9]|[2-9][0-9])/.test(document.body.innerText)", timeout=90_000)
        page.click("#stop")
        page.wait_for_function("/measured\\s+falling; \\d/.test(document.body.innerText)", timeout=60_000)
        assert re.search(r"command\s+falling, \d", page.inner_text("body"))
        page.wait_for_function("/measured\\s+off, /.test(document.body.innerText)", timeout=60_000)
        page.wait_for_function("document.getElementById('stop-said').innerText.includes('output off')", timeout=60_000)
        run.communicate(timeout=60.0)
        # the page's process has gone, and what it said last stands
        page.wait_for_function("document.body.innerText.includes('the run is over')", timeout=10_000)
        assert page.locator("#popup").is_hidden()
    assert run.returncode == 1


def _nobody_else_sees_anything(address: str, chromium) -> None:
    base = address.partition("?")[0]
    for path in ("", "picture.jpg", "_nicegui/", "?token=0"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(base + path, timeout=5.0)
        with refused.value as answer:
            assert (answer.code, answer.read()) == (404, b"not found")
    stranger = chromium.new_context().new_page()
    assert stranger.goto(base).status == 404
    stranger.context.close()


def test_closing_the_browser_changes_nothing_and_the_run_is_replayed(tmp_path):
    with watched_run(tmp_path) as (run, address):
        with browser() as chromium:
            page = chromium.new_page()
            page.goto(address)
            page.wait_for_function("window.framesShown > 3", timeout=90_000)
        time.sleep(2.0)
        assert run.poll() is None
        run.send_signal(signal.SIGINT)
        run.communicate(timeout=60.0)
        assert run.returncode == 130
    words = [sys.executable, "-m", "bender_cli", "live", "run"]
    replay = subprocess.Popen(words, cwd=tmp_path, env=OUTSIDE, stdout=subprocess.PIPE, text=True)
    try:
        assert replay.stdout is not None
        address = replay.stdout.readline().partition("replay: ")[2].strip()
        with browser() as chromium:
            page = chromium.new_page()
            assert page.goto(address).status == 200
            page.wait_for_function("document.body.innerText.includes('output off')", timeout=90_000)
            assert page.locator("#stop").count() == 0
    finally:
        replay.send_signal(signal.SIGINT)
        replay.communicate(timeout=20.0)
    assert replay.returncode == 0
