"""`bender hil`: the PID block, or a voltage profile, on a bench; with no bench file, on the emulated one."""

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from bender_loop.errors import InputError

if TYPE_CHECKING:
    from bender_hil.bench_file import BenchFile
    from bender_hil.runner.eyes import Sight
    from bender_hil.runner.loop import Witness
    from bender_hil.runner.program import Program
    from bender_hil.runner.run import RunResult
    from bender_loop.control.pid import Gains, Limits
    from bender_loop.shell.progress import Progress

    ReadGains = Callable[[Path], tuple[Gains, Limits, float]]

HELP = "run the controller or a voltage profile on a bench, emulated unless you name one"
EXAMPLE = """\
bender hil                                        # the emulated bench, a step to 20 µm
bender hil --setpoint 12 --duration 8 --gains results/tune/gains.toml
bender hil --profile staircase                    # the staircase of the paper, open loop
bender hil --bench bench.toml --profile mine.csv --out results/monday
bender hil replay results/monday                  # recompute every command from the log"""

SETPOINT_UM, DURATION_S = 20.0, 5.0
SLEW_SHARE = 0.9
"""The controller keeps to this share of the guard's slew limit, so that the guard never has to."""
INTERRUPTED = 130
_FRAMES_SHOWN = 15
OWN_GAINS = Path(__file__).with_name("gains.toml")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare everything."""
    parser.add_argument(
        "action", nargs="?", choices=["replay"], help="replay: recompute every command of a run from its log"
    )
    parser.add_argument("run_directory", nargs="?", type=Path, metavar="RUN", help="directory of the run to replay")
    parser.add_argument("--bench", type=Path, metavar="FILE", help="bench file (default: the emulated bench)")
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--profile",
        metavar="FILE",
        help="CSV with time_s and voltage_V (open loop) or setpoint_um, or: staircase, sine",
    )
    what.add_argument("--setpoint", type=float, metavar="UM", help=f"set-point in µm (default: {SETPOINT_UM:g})")
    parser.add_argument("--duration", type=float, metavar="S", help=f"default: {DURATION_S:g}, or that of the profile")
    parser.add_argument("--gains", type=Path, metavar="FILE", help="gains.toml of `bender tune`")
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: results/hil-DATE-TIME")


def run(arguments: argparse.Namespace, *, fmu: Callable[[str], Path], read_gains: "ReadGains") -> int:
    """Run, or replay; returns the exit status.

    Args:
        arguments: as `add_arguments` declares them.
        fmu: makes the FMU of a model, for the emulated bench.
        read_gains: reads a gains file.

    Returns:
        0; 1 for a run that tripped or a replay that differs; 3 when the output could not be confirmed off; 130 after
        an interrupt, with the output off.

    Raises:
        InputError: bad settings or files, no camera, another instrument at the address.
        RunError: no supply, no tip.
    """
    if arguments.action == "replay":
        return _replay(arguments)

    from bender_hil.bench_file import emulated_bench, read_bench
    from bender_hil.guard.guard import Status
    from bender_hil.guard.start import OutputUnknownError
    from bender_hil.runner.run import run as run_bench
    from bender_loop.shell.progress import Progress

    bench = emulated_bench() if arguments.bench is None else read_bench(arguments.bench)
    program = make_program(arguments, bench, read_gains)
    if arguments.out is None:
        arguments.out = Path("results") / f"hil-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    try:
        with Progress("run") as progress:
            show = _shown(progress, round(program.duration_s * bench.camera.frames_per_s))
            result = run_bench(bench, program, arguments.out, fmu=fmu, witness=show)
    except OutputUnknownError as error:
        sys.stderr.write(f"bender: {error}\n")
        return Status.UNCONFIRMED
    report(result)
    if result.ended.status is Status.UNCONFIRMED:
        sys.stderr.write(f"bender: {result.ended.alarm}\n")
        return Status.UNCONFIRMED
    if result.interrupted:
        sys.stderr.write(f"bender: interrupted, the output is off; the run is in {result.directory}\n")
        return INTERRUPTED
    if result.ended.code is not None:
        sys.stderr.write(f"bender: the run was ended ({result.ended.code}): {result.ended.sentence}\n")
        return Status.TRIPPED
    return 0


def make_program(arguments: argparse.Namespace, bench: "BenchFile", read_gains: "ReadGains") -> "Program":
    """What the words on the command line ask for.

    Raises:
        InputError: a profile or gains file is not fit, or a number out of its range.
    """
    from bender_hil.runner.program import ClosedLoop, OpenLoop
    from bender_hil.runner.voltages import SINE_V, Voltages, read_profile_file
    from bender_loop.control.pid import Limits
    from bender_loop.control.references import Step

    duration_s = arguments.duration
    if duration_s is not None and not 0.0 < duration_s < 1e6:
        raise InputError(f"--duration: found {duration_s!r}, expected seconds above 0")
    both = bench.guard.minimum_V <= -SINE_V
    reference = None if arguments.profile is None else read_profile_file(arguments.profile, both_polarities=both)
    if isinstance(reference, Voltages):
        if arguments.duration is not None or arguments.gains is not None:
            raise InputError("--duration and --gains belong to the closed loop; a voltage profile has its own length")
        _within(reference.levels_V, bench)
        return OpenLoop(reference)
    setpoint_um = SETPOINT_UM if arguments.setpoint is None else arguments.setpoint
    levels = (setpoint_um,) if reference is None else reference.setpoints_um
    low_um, high_um = bench.guard.travel_um
    for level in levels:
        if not low_um <= level <= high_um:
            raise InputError(
                f"setpoint: found {level!r} um, expected a place within the travel, {low_um:g} ... {high_um:g}"
            )
    path = _gains_path(arguments, bench)
    gains, limits, period_s = read_gains(path)
    if not 0.8 <= period_s * bench.camera.frames_per_s <= 1.25:
        sys.stderr.write(
            f"note: {path} was tuned for {1.0 / period_s:.3g} frames per second, the camera gives "
            f"{bench.camera.frames_per_s:.3g}\n"
        )
    guard = bench.guard
    lower_V, upper_V = max(guard.minimum_V, limits.lower_V), min(guard.maximum_V, limits.upper_V)
    limits = Limits(lower_V, upper_V, limits.tracking_time_s)
    if duration_s is None:
        duration_s = DURATION_S if reference is None else max(reference.times_s[-1] + 1.0, 1.0)
    step = Step(setpoint_um) if reference is None else reference
    return ClosedLoop(step, gains, limits, SLEW_SHARE * bench.guard.slew_V_per_s, duration_s)


def report(result: "RunResult") -> None:
    """Print the figures of a run and write them to `summary.json`."""
    from bender_hil.log.figures import staircase_figures, step_figures
    from bender_hil.log.journal import finite
    from bender_loop.records.record import read_record
    from bender_loop.shell.files import write_atomically
    from bender_loop.shell.progress import print_table

    summary = result.summary
    facts = {"ended": _ending(result), **asdict(summary)}
    median, high, most = summary.frame_to_command_ms
    rows: list[list[str | float | int | None]] = [
        ["ticks, skipped, late, lost", f"{summary.ticks}, {summary.skipped}, {summary.late}, {summary.lost}"],
        ["frame to command, ms: median, p99, max", f"{median:.2f}, {high:.2f}, {most:.2f}"],
        ["commands clamped, slowed by the guard", f"{summary.clamped}, {summary.slowed}"],
        ["ended", _ending(result)],
        ["output off, harmless, ms after the end", f"{_ms(summary.off_after_ms)}, {_ms(summary.harmless_after_ms)}"],
    ]
    if result.record is not None:
        record = read_record(result.record)
        step, stairs = step_figures(record), staircase_figures(record)
        if step is not None:
            facts["step"] = asdict(step)
            rows.append(["overshoot %, settling s (2 %), error um", _step_words(step)])
        if stairs is not None:
            facts["staircase"] = asdict(stairs)
            rows += _stairs_rows(stairs)
    text = json.dumps(finite(facts), indent=2, allow_nan=False)
    write_atomically(result.directory / "summary.json", text + "\n")
    print_table(f"run on the {'emulated ' if summary.emulated else ''}bench", ["what", "found"], rows)
    sys.stdout.write(f"written: {result.directory} (run.jsonl, guard.jsonl, record.csv, summary.json)\n")


def _shown(progress: "Progress", frames: int) -> "Witness":
    """What shows a run's progress twice a second, after the command of that frame has gone."""
    seen = 0

    def show(sight: "Sight") -> None:
        nonlocal seen
        seen += 1
        if seen % _FRAMES_SHOWN == 0:
            progress.update(seen, frames, "no tip" if sight.tip_um is None else f"{sight.tip_um:.2f} um")

    return show


def _replay(arguments: argparse.Namespace) -> int:
    from bender_hil.log.replay import replay_run

    if arguments.run_directory is None:
        raise InputError("replay: name the directory of a run")
    replayed = replay_run(arguments.run_directory)
    if replayed.different:
        sys.stderr.write(
            f"bender: {replayed.different} of {replayed.ticks} commands differ, from tick {replayed.first} on, by "
            f"{replayed.largest_V:.3g} V at most; the log and this controller do not belong together\n"
        )
        return 1
    sys.stdout.write(f"{replayed.ticks} commands recomputed from the log, all the same to the last bit\n")
    return 0


def _gains_path(arguments: argparse.Namespace, bench: "BenchFile") -> Path:
    if arguments.gains is not None:
        return arguments.gains
    return OWN_GAINS if bench.controller.gains is None else bench.resolve(bench.controller.gains)


def _within(levels_V: tuple[float, ...], bench: "BenchFile") -> None:
    lowest_V, highest_V = bench.guard.minimum_V, bench.guard.maximum_V
    for level_V in levels_V:
        if not lowest_V <= level_V <= highest_V:
            raise InputError(f"--profile: found {level_V!r} V, the guard allows {lowest_V:g} ... {highest_V:g} V")


def _ending(result: "RunResult") -> str:
    ended = result.ended
    if ended.alarm:
        return ended.alarm
    return "as planned, output off" if ended.code is None else f"{ended.code}: {ended.sentence}; output off"


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{value:.0f}"


def _step_words(step: object) -> str:
    figures = asdict(step)  # pyright: ignore[reportArgumentType]
    return "{overshoot_percent:.2f}, {settling_time_s:.3f}, {steady_state_error_um:+.3f}".format(**figures)


def _stairs_rows(stairs: object) -> list[list[str | float | int | None]]:
    from bender_hil.log.figures import PAPER_R2_DOWN, PAPER_R2_UP, PAPER_SENSITIVITY_UM_PER_V, Staircase

    if not isinstance(stairs, Staircase):
        return []
    return [
        [
            f"sensitivity up, down, um/V (paper: {PAPER_SENSITIVITY_UM_PER_V})",
            f"{stairs.up.sensitivity_um_per_V:.3f}, {stairs.down.sensitivity_um_per_V:.3f}",
        ],
        [
            f"R2 up, down (paper: {PAPER_R2_UP}, {PAPER_R2_DOWN})",
            f"{stairs.up.r_squared:.4f}, {stairs.down.r_squared:.4f}",
        ],
        ["widest loop, um", f"{stairs.loop_width_um:.2f}"],
    ]
