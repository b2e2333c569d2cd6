"""Real browsers on the page of a run, in a process of their own (`python -m …`): Chromium, driven by Playwright.

One line of JSON in, one out. Each browser is a Chromium of its own; the first one presses STOP. A picture counts as
drawn when the browser paints a frame of the page with another picture in it than before. Times are those of
`time.perf_counter`, which all processes of a machine share.
"""

import contextlib
import json
import shutil
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

from bender_loop.errors import InputError, RunError
from bender_loop.shell.closed_at_exit import ClosedAtExit
from bender_loop.shell.process_group import own_group

WAYS = ("click", "space bar")
WIDTHS_PX = (1280, 400)
HEIGHTS_PX = {1280: 900, 400: 850}
_OPEN_MS = 90_000
_COUNT = """(() => {
  let last = undefined, painted = Number(sessionStorage.getItem("painted"));
  const look = () => {
    const shown = document.getElementById("picture")?.dataset.frame;
    if (shown !== last) { last = shown; sessionStorage.setItem("painted", painted += 1); }
    requestAnimationFrame(look);
  };
  look();
})()"""
"""The page may load itself anew, after the connection to its server was lost: the count goes on."""


class Browsers(ClosedAtExit):
    """The process of the browsers, from the side of whoever measures; a context manager that ends it.

    Args:
        count: of browsers.

    Raises:
        InputError: Playwright or Chromium is missing.
    """

    def __init__(self, count: int) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "bender_studies.bench_trials.browser_clients", str(count)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            **own_group(),
        )
        try:
            self._heard()
        except BaseException:
            self.close()
            raise

    def ask(self, what: str, **facts: Any) -> dict[str, Any]:
        """Have something done, one of the methods of `_Clients`; returns what is said of it.

        Raises:
            RunError: a browser cannot do it.
        """
        if self._process.stdin is None:
            raise RunError("the browsers' process has no pipes")
        self._process.stdin.write(json.dumps({"do": what, **facts}) + "\n")
        self._process.stdin.flush()
        return self._heard()

    def close(self) -> None:
        """End the browsers."""
        if self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.close()
        try:
            self._process.wait(30.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _heard(self) -> dict[str, Any]:
        line = self._process.stdout.readline() if self._process.stdout is not None else ""
        if not line:
            raise RunError("the browsers' process has gone; see its message above")
        told = json.loads(line)
        if "missing" in told:
            raise InputError(str(told["missing"]))
        if "failed" in told:
            raise RunError(f"the browsers: {told['failed']}")
        return told


class _Clients:
    """The browsers themselves."""

    def __init__(self, browsers: list[Any]) -> None:
        self._browsers, self._pages = browsers, []

    def open(self, url: str) -> dict[str, Any]:
        """Open the page in every browser and wait until it shows pictures."""
        self._pages = [x.new_page(viewport={"width": 1280, "height": 900}) for x in self._browsers]
        for page in self._pages:
            page.add_init_script(_COUNT)
            page.goto(url, timeout=_OPEN_MS)
        for page in self._pages:
            page.wait_for_function("window.framesShown > 3", timeout=_OPEN_MS)
        return {"title": self._pages[0].title()}

    def measure(self, seconds: float, windows: int) -> dict[str, Any]:
        """Return how many pictures per second each browser paints, and the fewest in a window."""
        rates: list[list[float]] = [[] for _ in self._pages]
        for _ in range(windows):
            before = [self._painted(x) for x in self._pages]
            self._pages[0].wait_for_timeout(1e3 * seconds / windows)
            for rate, page, (count, when_s) in zip(rates, self._pages, before, strict=True):
                later, later_s = self._painted(page)
                rate.append((later - count) / (later_s - when_s))
        return {"mean": [sum(x) / len(x) for x in rates], "fewest": [min(x) for x in rates]}

    def stop(self, way: str) -> dict[str, Any]:
        """Press STOP in the first browser; returns when that began."""
        page = self._pages[0]
        button = page.locator("#stop")
        box = button.bounding_box()
        pressed_s = time.perf_counter()
        if way == "click":
            page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        else:
            page.keyboard.press("Space")
        return {"pressed_s": pressed_s}

    def said(self) -> dict[str, Any]:
        """Return what the page says of STOP, once the button has answered."""
        page = self._pages[0]
        said = "document.getElementById('stop-said').textContent"
        page.wait_for_function(f"{said}.length > 0 && !{said}.includes('being said')", timeout=20_000)
        return {"said": page.evaluate(said)}

    def strangers(self, url: str, stop_url: str) -> dict[str, Any]:
        """Return every address that shows something to somebody without the token."""
        page_base, stop_base = url.partition("?")[0], stop_url.rsplit("/", 2)[0] + "/"
        paths = ("", "picture.jpg", "_nicegui/", "?token=0")
        seen = [page_base + x for x in paths if not _is_refused(page_base + x, "GET")]
        seen += [x for x in (stop_base, stop_base + "0/stop") if not _is_refused(x, "POST")]
        context = self._browsers[0].new_context()
        answer = context.new_page().goto(page_base)
        if answer is None or answer.status != 404 or answer.text() != "not found":
            seen.append(f"{page_base} in a browser")
        context.close()
        return {"seen": seen}

    def pictures(self, folder: str) -> dict[str, Any]:
        """Write a picture of the page at each width; returns their files and whether any is wider than its window."""
        files, wide = [], []
        page = self._pages[-1]
        for width_px in WIDTHS_PX:
            page.set_viewport_size({"width": width_px, "height": HEIGHTS_PX[width_px]})
            page.wait_for_timeout(1500)
            path = Path(folder) / f"page-{width_px}.png"
            page.screenshot(path=str(path), full_page=True)
            files.append(str(path))
            if page.evaluate("document.documentElement.scrollWidth") > width_px:
                wide.append(width_px)
        page.set_viewport_size({"width": WIDTHS_PX[0], "height": HEIGHTS_PX[WIDTHS_PX[0]]})
        return {"files": files, "too_wide": wide}

    def leave(self) -> dict[str, Any]:
        """Close the pages; the browsers stay."""
        for page in self._pages:
            page.close()
        self._pages = []
        return {}

    @staticmethod
    def _painted(page: Any) -> tuple[int, float]:
        for patience in range(20, -1, -1):
            try:
                return int(page.evaluate("Number(sessionStorage.getItem('painted'))")), time.perf_counter()
            except Exception:  # the page is loading itself anew
                if not patience:
                    raise
                page.wait_for_timeout(250)
        raise AssertionError


def _is_refused(url: str, method: str) -> bool:
    try:
        with urllib.request.urlopen(urllib.request.Request(url, method=method), timeout=5.0):
            return False
    except urllib.error.HTTPError as answer:
        with answer:
            return (answer.code, answer.read()) == (404, b"not found")


def main() -> int:
    """Serve until the standard input ends."""
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError as error:
        _say(missing=f"--browsers: Playwright cannot be imported ({error}); install it with: pip install playwright")
        return 2
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    with contextlib.ExitStack() as ends:
        driver = ends.enter_context(sync_playwright())
        browsers = []
        try:
            for _ in range(int(sys.argv[1])):
                browsers.append(driver.chromium.launch(executable_path=found, args=["--no-sandbox"]))
                ends.callback(browsers[-1].close)
        except Error as error:
            reason = str(error).splitlines()[0]
            _say(missing=f"--browsers: Chromium cannot be started ({reason}); install it: playwright install chromium")
            return 2
        clients = _Clients(browsers)
        _say(ready=True)
        for line in sys.stdin:
            order = json.loads(line)
            try:
                _say(**getattr(clients, order.pop("do"))(**order))
            except Exception as error:  # whoever asked ends the run, whatever it is
                _say(failed=f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}")
    return 0


def _say(**words: Any) -> None:
    sys.stdout.write(json.dumps(words) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.exit(main())
