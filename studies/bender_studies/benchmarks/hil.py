"""`bender benchmark hil`: cadence and reaction times of the emulated bench, the step and the staircase."""

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bender_hil.runner.program import Program

HELP = "the bench: deadlines, delays, reaction times, and what a step and a staircase give"
PARTS = ("cadence", "serial", "fast", "reactions", "step", "staircase", "daq")

ALONE = "daq"
"""Measured only where it is asked for: it takes many minutes."""

KILOHERTZ_P99_MS = 0.6

Row = list[str | float | int | None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what to measure and for how long."""
    parser.add_argument(
        "--parts",
        type=lambda text: text.split(","),
        metavar="PART,...",
        help=f"of {', '.join(PARTS)} (default: all but {ALONE})",
    )
    parser.add_argument("--realtime", action="store_true", help="real-time priority for controller and guard (Linux)")
    parser.add_argument(
        "--minutes", type=float, default=10.0, metavar="N", help="length of the long runs (default: 10)"
    )
    parser.add_argument(
        "--repeats", type=int, default=10, metavar="N", help="repetitions of each reaction (default: 10)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the tables, write hil.json; 1 when a target is missed."""
    from bender_export.build import ensure_plant_fmu
    from bender_loop.errors import InputError
    from bender_loop.shell.files import finite, prepare_directory, result_text, write_atomically

    parts = arguments.parts or [part for part in PARTS if part != ALONE]
    for part in parts:
        if part not in PARTS:
            raise InputError(f"--parts: found {part!r}, expected some of {', '.join(PARTS)}")
    if not 0.01 <= arguments.minutes <= 1000.0 or arguments.repeats < 1:
        raise InputError("--minutes and --repeats: expected numbers above 0")
    out: Path = prepare_directory(arguments.out)
    fmu = ensure_plant_fmu("bench")
    facts: dict[str, object] = {}
    met = []
    for part in parts:
        facts[part], is_met = _measured(part, arguments, fmu, out)
        met.append(is_met)
        write_atomically(out / "hil.json", result_text(finite(facts), default=str))
    sys.stdout.write(f"written: {out / 'hil.json'}\n")
    return 0 if all(met) else 1


def _measured(part: str, arguments: argparse.Namespace, fmu: Path, out: Path) -> tuple[object, bool]:
    minutes: float = arguments.minutes
    match part:
        case "cadence":
            return _cadence(arguments, "30 frames/s over TCP", "tcp", 30.0, 60.0 * minutes, fmu, p99_ms=15.0, late=0)
        case "serial":
            seconds = 60.0 * min(minutes, 1.0)
            return _cadence(arguments, "30 frames/s, 57600 baud", "pty", 30.0, seconds, fmu, p99_ms=25.0, late=0)
        case "fast":
            seconds = 60.0 * min(minutes, 1.0)
            return _cadence(arguments, "90 frames/s over TCP", "tcp", 90.0, seconds, fmu, p99_ms=None, late=1)
        case "daq":
            return _kilohertz(arguments, 60.0 * minutes, fmu)
        case "reactions":
            return _reactions(arguments.repeats, fmu)
        case _:
            return _run_command(part, out)


def _cadence(
    arguments: argparse.Namespace,
    title: str,
    link: str,
    rate_Hz: float,
    seconds: float,
    fmu: Path,
    *,
    p99_ms: float | None,
    late: int,
) -> tuple[object, bool]:
    from bender_hil.emulated import EmulationSettings
    from bender_loop.shell.files import unused
    from bender_loop.shell.progress import print_table
    from bender_studies.bench_trials.cadence import measure_cadence

    folder, emulation = unused(arguments.out / f"{link}-{rate_Hz:g}"), EmulationSettings(link=link)
    found = measure_cadence(_walk(seconds), emulation, rate_Hz, fmu, folder, realtime=arguments.realtime)
    median, high, most = found.photon_to_command_ms
    is_met = found.late <= late and found.skipped == 0 and found.unsent == 0 and found.ended.code is None
    is_met = is_met and (p99_ms is None or high <= p99_ms)
    rows: list[Row] = [
        ["ended", found.ended.code or "by no rule", None],
        ["ticks, per second", f"{found.ticks}, {found.rate_Hz:.3f}", None],
        ["frames dropped by us", found.skipped + found.unsent, "0"],
        ["ticks late", found.late, f"<= {late}"],
        ["frames that the emulated camera drew late", found.late_frames, None],
        ["photon to command, ms: median", median, None],
        ["photon to command, ms: p99", high, None if p99_ms is None else f"<= {p99_ms:g}"],
        ["photon to command, ms: max", most, None],
        ["photon to frame, ms: median, p99", "{:.2f}, {:.2f}".format(*found.photon_to_frame_ms), None],
        ["tip error, µm rms", found.tip_error_um, None],
    ]
    how = ", with priority" if arguments.realtime else ""
    print_table(f"{title}, {seconds:g} s{how}: {_verdict(is_met)}", ["what", "found", "target"], rows)
    return asdict(found), is_met


def _kilohertz(arguments: argparse.Namespace, seconds: float, fmu: Path) -> tuple[object, bool]:
    from bender_loop.shell.files import unused
    from bender_loop.shell.progress import print_table
    from bender_studies.bench_trials.kilohertz import ALONE_S, measure_kilohertz

    folder = unused(arguments.out / "daq")
    found = measure_kilohertz(_walk(seconds), fmu, folder, realtime=arguments.realtime)
    median_ms, high_ms, most_ms = found.delay_ms
    is_met = found.code is None and found.late == 0 and found.skipped == 0 and high_ms <= KILOHERTZ_P99_MS
    rows: list[Row] = [
        ["ended", found.code or "by no rule", None],
        ["ticks", found.ticks, f"{seconds * 1e3:.0f}"],
        ["readings passed over", found.skipped, "0"],
        ["ticks late", found.late, "0"],
        ["complete reading to command, ms: median", median_ms, None],
        ["complete reading to command, ms: p99", high_ms, f"<= {KILOHERTZ_P99_MS:g}"],
        ["complete reading to command, ms: max", most_ms, None],
        [f"waits of 1 ms that last 2 ms, in {ALONE_S:g} s without a bench", found.alone, None],
        ["load of the machine before, processors", f"{found.load:.1f}, {found.processors}", None],
    ]
    how = ", with priority" if arguments.realtime else ""
    print_table(f"1 kHz on a DAQ, {seconds:g} s{how}: {_verdict(is_met)}", ["what", "found", "target"], rows)
    return asdict(found), is_met


def _reactions(repeats: int, fmu: Path) -> tuple[object, bool]:
    from bender_hil.emulated import EmulationSettings
    from bender_loop.shell.progress import print_table
    from bender_studies.bench_trials.reactions import REACTIONS, measure_reactions

    targets = {"kill -9": ("off_ms", 150.0), "frozen": ("off_ms", 250.0), "camera stall": ("ramp_ms", 150.0)}
    rows: list[Row] = []
    facts = {}
    met = True
    for event in REACTIONS:
        found = measure_reactions(event, repeats, EmulationSettings(), fmu)
        facts[event] = [asdict(one) for one in found]
        name, bound = targets[event]
        worst = {key: max(getattr(one, key) for one in found) for key in ("ramp_ms", "off_ms", "harmless_ms")}
        met = met and worst[name] <= bound
        what = "off" if name == "off_ms" else "ramp"
        target = f"{what} <= {bound:g} ms"
        rows.append([event, worst["ramp_ms"], worst["off_ms"], worst["harmless_ms"], target, found[0].code])
    columns = ["event", "ramp begins, ms", "OUTP? off, ms", "below 1 V, ms", "target", "reason"]
    print_table(f"Reaction from 45 V, worst of {repeats}: {_verdict(met)}", columns, rows)
    return facts, met


def _hil(*words: str) -> int:
    """Run the bench's own command; returns its exit status."""
    from bender_export.build import ensure_plant_fmu
    from bender_hil.command import add_arguments, run
    from bender_tuner.results.gains_file import read_gains

    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return run(parser.parse_args(words), fmu=lambda model: ensure_plant_fmu(model), read_gains=read_gains)


def _run_command(part: str, out: Path) -> tuple[object, bool]:
    """A run by the command itself, which prints its own table."""
    from bender_loop.shell.files import unused

    folder = unused(out / part)
    words = ["--setpoint", "20"] if part == "step" else ["--profile", "staircase"]
    status = _hil(*words, "--out", str(folder))
    if status != 0:
        return {"status": status}, False
    facts = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    if part == "staircase":
        return facts["staircase"], _hil("replay", str(folder)) == 0
    step = facts["step"]
    met = step["overshoot_percent"] <= 5.0 and step["settling_time_s"] is not None and step["settling_time_s"] <= 1.0
    sys.stdout.write(f"step to 20 µm: overshoot <= 5 %, settling <= 1 s: {_verdict(met)}\n")
    return step, met and _hil("replay", str(folder)) == 0


def _walk(seconds: float) -> "Program":
    """A closed loop on setpoints that change every two seconds, with the gains of the package."""
    import numpy as np

    from bender_hil.command import OWN_GAINS
    from bender_hil.runner.program import ClosedLoop
    from bender_loop.control.references import Profile
    from bender_tuner.results.gains_file import read_gains

    gains, limits, _ = read_gains(OWN_GAINS)
    levels: Sequence[float] = np.random.default_rng(0).uniform(3.0, 18.0, int(seconds / 2.0) + 1).tolist()
    times = tuple(2.0 * k for k in range(len(levels)))
    return ClosedLoop(Profile(times, tuple(levels)), gains, limits, 225.0, seconds)


def _verdict(is_met: bool) -> str:
    return "met" if is_met else "NOT MET"
