"""`bender benchmark live`: from STOP to an output that is off, and pictures per second, while a run is watched."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from bender_hil.emulator.bench import EmulatedBench
    from bender_hil.live.session import LiveSession

HELP = "how quickly STOP on the page switches the output off, with two clients that watch"
LIMIT_MS, LEAST_PER_S = 200.0, 15.0
CLIENTS = 2


class Stopped(NamedTuple):
    """One run that was stopped: STOP to off in ms, pictures per second of each client, ticks and late ones."""

    off_ms: float
    pictures_per_s: tuple[float, ...]
    ticks: int
    late: int


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how often."""
    parser.add_argument("--times", type=int, default=10, metavar="N", help="runs that are stopped (default: 10)")
    parser.add_argument("--seconds", type=float, default=6.0, metavar="S", help="of a run before STOP (default: 6)")


def run(arguments: argparse.Namespace) -> int:
    """Stop runs of the emulated bench and print the figures; returns 0 where all of them are in time."""
    import tempfile

    from bender_loop.shell.progress import Progress, print_table

    found: list[Stopped] = []
    with tempfile.TemporaryDirectory() as folder, Progress("STOP, runs") as bar:
        for number in range(arguments.times):
            found.append(stopped_run(Path(folder) / f"run-{number}", arguments.seconds))
            bar.update(len(found), arguments.times, f"{found[-1].off_ms:.0f} ms")
    times = sorted(x.off_ms for x in found)
    least = min(min(x.pictures_per_s) for x in found)
    in_time = sum(x <= LIMIT_MS for x in times)
    rows = [
        ["STOP to output off, ms: median, most", f"{times[len(times) // 2]:.0f}, {times[-1]:.0f}"],
        [f"within {LIMIT_MS:g} ms", f"{in_time} of {len(times)}"],
        [f"pictures per second, the fewest of {CLIENTS} clients", f"{least:.1f}"],
        ["ticks, late", f"{sum(x.ticks for x in found)}, {sum(x.late for x in found)}"],
    ]
    print_table("A watched run on the emulated bench", ["what", "found"], rows)
    sys.stdout.flush()
    return 0 if in_time == len(times) and least >= LEAST_PER_S else 1


def stopped_run(folder: Path, seconds: float) -> Stopped:
    """Run the loop on the emulated bench, watched by two clients, and press STOP as a browser does."""
    import threading
    import time

    from bender_hil.bench_file import BenchFile
    from bender_hil.command import OWN_GAINS
    from bender_hil.emulator.bench import EmulationSettings
    from bender_hil.guard.settings import GuardSettings
    from bender_hil.live.session import LiveSession
    from bender_hil.runner.program import ClosedLoop
    from bender_hil.runner.run import run as run_bench
    from bender_loop.control.references import Step
    from bender_native.ready import ready_plant_fmu
    from bender_tuner.results.gains_file import read_gains

    gains, limits, _ = read_gains(OWN_GAINS)
    guard = GuardSettings(heartbeat_s=2.0, frame_age_s=2.0)
    bench = BenchFile(guard=guard, emulator=EmulationSettings())
    program = ClosedLoop(Step(20.0), gains, limits, 0.9 * guard.slew_V_per_s, seconds + 60.0)
    pressed: list[float] = []
    off: list[float] = []
    rates: list[float] = []
    emulated: list[Any] = []

    with LiveSession(folder) as session:

        def begin(found: "EmulatedBench | None") -> None:
            emulated.append(found)
            for _ in range(CLIENTS):
                threading.Thread(target=lambda: rates.append(_watched(session, seconds)), daemon=True).start()
            threading.Timer(seconds, lambda: pressed.append(_press(session))).start()

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
        time.sleep(1.0)
    return Stopped(1e3 * (off[0] - pressed[0]), tuple(rates), result.summary.ticks, result.summary.late)


def _press(session: "LiveSession") -> float:
    """Press STOP; returns when."""
    import time
    import urllib.request

    pressed_s = time.perf_counter()
    with urllib.request.urlopen(urllib.request.Request(session.stop_url, method="POST"), timeout=10.0) as answer:
        answer.read()
    return pressed_s


def _watched(session: "LiveSession", seconds: float) -> float:
    """Ask for every new picture, as the page does; returns how many came per second."""
    import time
    import urllib.request

    base, _, token = session.url.partition("?")
    begin_s, count, last = time.perf_counter(), 0, "-1"
    while (passed_s := time.perf_counter() - begin_s) < seconds:
        with urllib.request.urlopen(f"{base}picture.jpg?after={last}&{token}", timeout=10.0) as answer:
            if answer.status == 200:
                answer.read()
                last = answer.headers["X-Frame"]
                count += 1
    return count / passed_s
