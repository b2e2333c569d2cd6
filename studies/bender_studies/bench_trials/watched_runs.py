"""`bender benchmark live`: from STOP to an output that is off, and pictures per second, while a run is watched.

Clients that ask for pictures as the page does, or real browsers. STOP is pressed by a click, by the space bar, and by
the space bar while the page's own server is stopped by SIGSTOP, in turn.
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from bender_hil.emulated import EmulatedBench
    from bender_hil.live.session import LiveSession
    from bender_studies.bench_trials.browser_clients import Browsers

HELP = "how quickly STOP on the page switches the output off, with clients or browsers that watch"
LIMIT_MS, LEAST_PER_S = 200.0, 15.0
CLIENTS = 2
WINDOW_S = 10.0
"""In a long run the fewest pictures per second are those of the worst stretch of this length."""
HANGING = "space bar, the page's server stopped"
PRESSES = ("click", "space bar", HANGING)
_ROOM_S = 200.0
"""A run is so much longer than what is measured: browsers take their time to open."""


class Stopped(NamedTuple):
    """One run that was stopped.

    Attributes:
        press: how.
        off_ms: from STOP to the output off.
        pictures_per_s: of each client.
        fewest_per_s: of each client, in its worst stretch.
        ticks, late: of the loop.
        said: by the page, of STOP.
        seen: addresses that showed something to a stranger.
        pictures: of the page.
        too_wide: windows, in pixels, that the page did not fit.
        failure: why there is no figure, empty where there is one.
    """

    press: str
    off_ms: float
    pictures_per_s: tuple[float, ...]
    fewest_per_s: tuple[float, ...]
    ticks: int
    late: int
    said: str = ""
    seen: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()
    too_wide: tuple[int, ...] = ()
    failure: str = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how often, how long and who watches."""
    parser.add_argument("--times", type=int, default=10, metavar="N", help="runs that STOP ends (default: 10)")
    parser.add_argument(
        "--seconds", type=float, default=6.0, metavar="S", help="seconds of a run before STOP (default: 6)"
    )
    parser.add_argument("--minutes", type=float, metavar="M", help="also one watched run of this length")
    parser.add_argument(
        "--browsers", type=int, default=0, metavar="N", help="real browsers that watch (Playwright and Chromium)"
    )
    parser.add_argument(
        "--realtime", action="store_true", help="with controller.realtime = true in the bench file (Linux)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Stop runs of the emulated bench and print the figures; returns 0 where all of them are in time."""
    import contextlib
    import tempfile

    from bender_loop.errors import InputError
    from bender_loop.shell.files import prepare_directory
    from bender_loop.shell.progress import Progress

    for name, low, high in (("times", 0, 1000), ("browsers", 0, 20)):
        if not low <= getattr(arguments, name) <= high:
            raise InputError(f"--{name} must be {low} to {high}, found {getattr(arguments, name)}")
    lengths_s = [arguments.seconds] * arguments.times + ([60.0 * arguments.minutes] if arguments.minutes else [])
    if not lengths_s or not all(1.0 <= x <= 86_400.0 for x in lengths_s):
        raise InputError("--times, --seconds, --minutes: expected a run at least, each of 1 s to a day")
    if arguments.browsers:
        prepare_directory(arguments.out)
    found: list[Stopped] = []
    before = _load()
    with contextlib.ExitStack() as ends:
        browsers = None
        if arguments.browsers:
            from bender_studies.bench_trials.browser_clients import Browsers

            browsers = ends.enter_context(Browsers(arguments.browsers))
        folder = ends.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True))
        bar = ends.enter_context(Progress("STOP, runs"))
        for number, seconds in enumerate(lengths_s):
            press = PRESSES[number % len(PRESSES)] if browsers is not None else PRESSES[0]
            place = Path(folder) / f"run-{number}"
            pictures = arguments.out if number == 0 else None
            found.append(stopped_run(place, seconds, press, browsers, pictures, realtime=arguments.realtime))
            bar.update(len(found), len(lengths_s), found[-1].failure or f"{press}: {found[-1].off_ms:.0f} ms")
    return _print_figures(found, arguments, f"{before} before, {_load()} after")


def _print_figures(found: list[Stopped], arguments: argparse.Namespace, load: str) -> int:
    """Print the figures; returns the exit status."""
    from bender_loop.shell.progress import print_table

    good = [x for x in found if not x.failure]
    rows: list[list[str]] = []
    for press in PRESSES:
        times = sorted(x.off_ms for x in good if x.press == press)
        if times:
            rows.append([f"{press} to output off, ms: median, most", f"{times[len(times) // 2]:.0f}, {times[-1]:.0f}"])
    in_time = sum(x.off_ms <= LIMIT_MS for x in good)
    least = min((min(x.pictures_per_s) for x in good), default=0.0)
    fewest = min((min(x.fewest_per_s) for x in good), default=0.0)
    who = f"{arguments.browsers} browsers" if arguments.browsers else f"{CLIENTS} clients"
    rows += [
        [f"within {LIMIT_MS:g} ms", f"{in_time} of {len(found)}"],
        [f"pictures per second, the slowest of {who}: mean, worst stretch", f"{least:.1f}, {fewest:.1f}"],
        ["ticks, late", f"{sum(x.ticks for x in good)}, {sum(x.late for x in good)}"],
    ]
    if arguments.minutes and good:
        rows.append([f"of these in {arguments.minutes:g} minutes on end", f"{good[-1].ticks}, {good[-1].late}"])
    if arguments.browsers:
        seen = sorted({address for x in good for address in x.seen})
        rows.append(["a client without the token sees", ", ".join(seen) or "nothing"])
    rows.append(["load of the machine over a minute", load])
    print_table("A watched run on the emulated bench", ["what", "found"], rows)
    for x in found:
        if x.failure:
            sys.stdout.write(f"failed: {x.failure}\n")
        for path in x.pictures:
            sys.stdout.write(f"written: {path}\n")
        for width_px in x.too_wide:
            sys.stdout.write(f"the page is wider than a window of {width_px} pixels\n")
    sys.stdout.flush()
    long_is_good = not arguments.minutes or (bool(good) and good[-1].late == 0)
    nobody_sees = not any(x.seen or x.too_wide for x in good)
    return 0 if in_time == len(found) and least >= LEAST_PER_S and long_is_good and nobody_sees else 1


def stopped_run(
    folder: Path,
    seconds: float,
    press: str,
    browsers: "Browsers | None" = None,
    pictures: Path | None = None,
    *,
    realtime: bool = False,
) -> Stopped:
    """Run the loop on the emulated bench, watched, and press STOP.

    Args:
        folder: of the run.
        seconds: for which it is watched.
        press: one of `PRESSES`; clients that are no browsers press as a browser's click does.
        browsers: that watch; None for clients that ask as the page does.
        pictures: where pictures of the page go, None for none.
        realtime: whether the loop and its guard run before every ordinary process.
    """
    import threading
    import time

    from bender_hil.bench_file import BenchFile, ControllerTable
    from bender_hil.command import OWN_GAINS
    from bender_hil.emulated import EmulationSettings
    from bender_hil.guard.settings import GuardSettings
    from bender_hil.live.session import LiveSession
    from bender_hil.runner.program import ClosedLoop
    from bender_hil.runner.run import run as run_bench
    from bender_loop.control.references import Step
    from bender_native.ready import ready_plant_fmu
    from bender_tuner.results.gains_file import read_gains

    gains, limits, _ = read_gains(OWN_GAINS)
    guard = GuardSettings(heartbeat_s=2.0, frame_age_s=2.0)
    bench = BenchFile(guard=guard, controller=ControllerTable(realtime=realtime), emulator=EmulationSettings())
    program = ClosedLoop(Step(20.0), gains, limits, 0.9 * guard.slew_V_per_s, seconds + _ROOM_S)
    off: list[float] = []
    emulated: list[Any] = []
    told: dict[str, Any] = {}
    at_work: list[threading.Thread] = []

    with LiveSession(folder) as session:

        def watch() -> None:
            try:
                if browsers is None:
                    told.update(_by_clients(session, seconds))
                else:
                    told.update(_by_browsers(session, seconds, press, browsers, pictures))
            except Exception as error:  # the run goes on until it is told to end
                told["failure"] = f"{type(error).__name__}: {error}"
                _press(session)

        def begin(found: "EmulatedBench | None") -> None:
            emulated.append(found)
            at_work.append(threading.Thread(target=watch, daemon=True))
            at_work[0].start()

        def end() -> None:
            off.append(float(emulated[0].supply.truth()["switched_off_s"]))

        result = run_bench(
            bench,
            program,
            folder,
            fmu=lambda model: ready_plant_fmu(model),
            witness=session.see,
            started=begin,
            finished=end,
            stop=session,
        )
        for thread in at_work:
            thread.join(60.0)
        time.sleep(0.2)
    pressed_s = float(told.pop("pressed_s", float("nan")))
    failure = str(told.pop("failure", ""))
    summary = result.summary
    if not failure and result.ended.code != "stop":
        failure = f"the run was ended by {result.ended.code}: {result.ended.sentence}"
    nothing = {"pictures_per_s": (0.0,), "fewest_per_s": (0.0,)}
    found = {**nothing, **told, "failure": failure}
    return Stopped(press, 1e3 * (off[0] - pressed_s), ticks=summary.ticks, late=summary.late, **found)


def _by_browsers(
    session: "LiveSession", seconds: float, press: str, browsers: "Browsers", pictures: Path | None
) -> dict[str, Any]:
    """Watch with browsers and press STOP in the first of them; returns what came of it."""
    import contextlib
    import os
    import signal
    import time

    told: dict[str, Any] = {}
    browsers.ask("open", url=session.url)
    windows = max(1, round(seconds / WINDOW_S))
    rates = browsers.ask("measure", seconds=seconds, windows=windows)
    told["pictures_per_s"], told["fewest_per_s"] = tuple(rates["mean"]), tuple(rates["fewest"])
    told["seen"] = tuple(browsers.ask("strangers", url=session.url, stop_url=session.stop_url)["seen"])
    if pictures is not None:
        shown = browsers.ask("pictures", folder=str(pictures))
        told["pictures"], told["too_wide"] = tuple(shown["files"]), tuple(shown["too_wide"])
    hangs = press == HANGING
    if hangs:
        os.kill(session.page_pid, signal.SIGSTOP)
        time.sleep(0.5)
    try:
        told["pressed_s"] = browsers.ask("stop", way="click" if press == "click" else "space bar")["pressed_s"]
        told["said"] = browsers.ask("said")["said"]
    finally:
        if hangs:
            with contextlib.suppress(ProcessLookupError):
                os.kill(session.page_pid, signal.SIGCONT)
    browsers.ask("leave")
    return told


def _by_clients(session: "LiveSession", seconds: float) -> dict[str, Any]:
    """Watch with clients that ask for every new picture, as the page does, and press STOP."""
    import threading

    rates: list[tuple[float, float]] = []
    watch: Callable[[], None] = lambda: rates.append(_watched(session, seconds))  # noqa: E731
    threads = [threading.Thread(target=watch, daemon=True) for _ in range(CLIENTS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    pressed_s = _press(session)
    return {
        "pictures_per_s": tuple(x for x, _ in rates),
        "fewest_per_s": tuple(x for _, x in rates),
        "pressed_s": pressed_s,
    }


def _press(session: "LiveSession") -> float:
    """Press STOP; returns when."""
    import time
    import urllib.request

    pressed_s = time.perf_counter()
    with urllib.request.urlopen(urllib.request.Request(session.stop_url, method="POST"), timeout=10.0) as answer:
        answer.read()
    return pressed_s


def _watched(session: "LiveSession", seconds: float) -> tuple[float, float]:
    """Ask for every new picture, as the page does; returns how many came per second, and in the worst stretch."""
    import time
    import urllib.request

    base, _, token = session.url.partition("?")
    begin_s, last = time.perf_counter(), "-1"
    windows = max(1, round(seconds / WINDOW_S))
    counts = [0] * windows
    while (passed_s := time.perf_counter() - begin_s) < seconds:
        with urllib.request.urlopen(f"{base}picture.jpg?after={last}&{token}", timeout=10.0) as answer:
            if answer.status == 200:
                answer.read()
                last = answer.headers["X-Frame"]
                counts[min(windows - 1, int(passed_s / seconds * windows))] += 1
    return sum(counts) / seconds, min(counts) * windows / seconds


def _load() -> str:
    """Return the load of the machine, "not known" where the system does not say."""
    import os

    return f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "not known"
