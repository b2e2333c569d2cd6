"""The charts of a report, half of them drawn by a process beside this one.

Drawing holds the interpreter: threads do not share that work. The process is begun before there is something to draw,
so that it has imported what it needs by then; this one imports it while it waits for something else.
"""

import contextlib
import gc
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping

from bender_compiled.parallel_map import cores
from bender_discrepancy.report import overlay_pictures, residual_pictures
from bender_discrepancy.report.pictured_record import PicturedRecord
from bender_report import chart
from bender_report.chart import Chart
from bender_report.wording import shown_in, unit_name

CHARTS: Mapping[str, Callable[[PicturedRecord], Chart | None]] = {
    "overlay": overlay_pictures.overlay,
    "whole": overlay_pictures.whole,
    "loop": overlay_pictures.loop,
    "residual": residual_pictures.over_time,
    "branches": residual_pictures.over_voltage,
    "map": residual_pictures.as_map,
    "spectrum": residual_pictures.over_frequency,
}
BESIDE = ("loop", "map", "spectrum")
"""What the other process draws: about half of the work."""


class ChartProcess:
    """A process that draws; one that was never begun, or has ended, draws nothing."""

    def __init__(self) -> None:
        self._child: subprocess.Popen[bytes] | None = None
        self._loading: threading.Thread | None = None

    def __enter__(self) -> "ChartProcess":
        return self

    def __exit__(self, *_: object) -> None:
        if self._child is not None:
            self._child.kill()
            self._child.communicate()

    def begin(self) -> None:
        """Begin the process where a core may be free; once."""
        if self._child is not None or cores() < 2:
            return
        words, pipe = [sys.executable, "-P", "-m", __name__], subprocess.PIPE
        with contextlib.suppress(OSError):
            self._child = subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL)

    def get_ready(self) -> None:
        """Import what drawing needs in this process too, in a thread; once."""
        if self._loading is None:
            self._loading = threading.Thread(target=chart.load, daemon=True)
            self._loading.start()

    def ask(self, shown: PicturedRecord, names: Iterable[str]) -> bool:
        """Have charts drawn; returns whether they will be."""
        if self._child is None or self._child.stdin is None:
            return False
        try:
            pickle.dump((shown, tuple(names), unit_name("V"), unit_name("um")), self._child.stdin)
            self._child.stdin.close()
        except OSError:
            return False
        self._child.stdin = None
        return True

    def drawn(self) -> dict[str, Chart | None]:
        """Return what was asked for; nothing where the process has ended without it."""
        if self._child is None or self._child.stdout is None:
            return {}
        try:
            return pickle.load(self._child.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            return {}


def charts_of(shown: PicturedRecord, chart_process: ChartProcess | None = None) -> dict[str, Chart | None]:
    """Return all charts by their names, the same whoever draws them."""
    asked = BESIDE if chart_process is not None and chart_process.ask(shown, BESIDE) else ()
    with _uncollected():
        found = {name: CHARTS[name](shown) for name in CHARTS if name not in asked}
    if chart_process is not None and asked:
        found |= chart_process.drawn()
    return {name: found[name] if name in found else draw(shown) for name, draw in CHARTS.items()}


@contextlib.contextmanager
def _uncollected() -> Iterator[None]:
    """Draw without collections of garbage: figures make so much that these look through all that a process holds."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def main() -> None:
    """Draw what is asked for on standard input."""
    # the terminal's Ctrl-C is for the process that this one draws for, which ends it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.disable()
    chart.load()
    shown, names, *units = pickle.load(sys.stdin.buffer)
    with shown_in(*units):
        pickle.dump({name: CHARTS[name](shown) for name in names}, sys.stdout.buffer)


if __name__ == "__main__":
    main()
