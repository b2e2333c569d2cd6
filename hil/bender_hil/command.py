"""`bender hil`: the PID block, or a voltage profile, on a bench; with no bench file, on the emulated one."""

import argparse
import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from bender_loop.errors import InputError

if TYPE_CHECKING:
    from bender_hil.bench_file import BenchFile
    from bender_hil.live.session import LiveSession
    from bender_hil.log.results import Results
    from bender_hil.runner.interrupts import Interrupts
    from bender_hil.runner.loop import Witness
    from bender_hil.runner.program import Program
    from bender_hil.runner.run import RunResult
    from bender_hil.runner.tip_camera import Sight
    from bender_hil.runner.voltages import Voltages
    from bender_loop.control.pid import Gains, Limits
    from bender_loop.fmu.followed_model import FollowedModel
    from bender_loop.shell.progress import Progress

    ReadGains = Callable[[Path], tuple[Gains, Limits, float]]
    ReadModel = Callable[[Path], FollowedModel | None]

HELP = "run the controller or a voltage profile on a bench, emulated unless you name one"
EXAMPLE = """\
bender hil                                        # the emulated bench, a step to 20 µm
bender hil --setpoint 12 --duration 8 --gains results/tune/gains.toml
bender hil --profile staircase                    # the staircase of the paper, open loop
bender hil --bench bench.toml --profile mine.csv --out results/monday
bender hil --profile scan.csv --gains results/retuned/gains.toml --open-loop    # the model's inverse alone
bender hil --profile scan.csv --gains results/retuned/gains.toml --learn 8
bender hil --controller mine.fmu                  # anybody's controller behind the same guard
bender hil --watch                                # and a page with picture, charts and STOP
bender hil replay results/monday                  # recompute every command from the journal
bender hil recover results/monday                 # the record of a run that was killed, from its journals
bender hil nexus results/monday                   # the run as HDF5 in the layout of NeXus"""

SETPOINT_UM, DURATION_S = 20.0, 5.0
SLEW_SHARE = 0.9
"""The controller keeps to this share of the guard's slew limit, so that the guard never has to."""
LARGEST_GAIN = 1e6
"""No loop has a gain of a million volts per micrometre."""
FAILED, INTERRUPTED = 1, 130
_FRAMES_SHOWN = 15
OWN_GAINS = Path(__file__).with_name("gains.toml")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare everything."""
    parser.add_argument(
        "action",
        nargs="?",
        choices=["replay", "recover", "nexus"],
        help="replay: check the journal of a run; recover: make the record and the summary of a run that was killed; "
        "nexus: write a run as HDF5 in the layout of NeXus",
    )
    parser.add_argument("run_directory", nargs="?", type=Path, metavar="RUN", help="directory of that run")
    parser.add_argument("--bench", type=Path, metavar="FILE", help="bench file (default: the emulated bench)")
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--profile",
        metavar="FILE",
        help="CSV with time_s and voltage_V (open loop) or setpoint_um, or: staircase, sine",
    )
    what.add_argument("--setpoint", type=float, metavar="UM", help=f"set-point in µm (default: {SETPOINT_UM:g})")
    parser.add_argument("--duration", type=float, metavar="S", help=f"default: {DURATION_S:g}, or that of the profile")
    parser.add_argument(
        "--gains",
        type=Path,
        metavar="FILE",
        help="gains.toml of `bender tune`; one with a model (--follow-model) runs the model-following controller "
        "(default: controller.gains of the bench file, or those of the paper's actuator)",
    )
    parser.add_argument("--no-model", action="store_true", help="the PID block alone, whatever the gains name")
    parser.add_argument(
        "--controller",
        type=Path,
        metavar="FILE",
        help="a controller FMU (setpoint, measurement → command) in place of the PID block: code that runs with your "
        "rights, behind the same guard",
    )
    parser.add_argument(
        "--open-loop",
        action="store_true",
        help="the inverse of the model that the gains name, without feedback; its expected error is said beforehand",
    )
    parser.add_argument(
        "--learn",
        type=int,
        metavar="N",
        help="run a profile up to N times, each with what the passes before have taught (needs gains with a model)",
    )
    parser.add_argument(
        "--no-preview",
        action="store_true",
        help="a model-following controller treats the set-points of a profile as unknown until they come",
    )
    parser.add_argument(
        "--buffered",
        action="store_true",
        help="the source plays the profile and the sensor records it by one clock, without a loop (DAQ)",
    )
    parser.add_argument(
        "--watch",
        action="store_true",
        help="serve a page with picture, charts and STOP (extra live)",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: results/hil-DATE-TIME")


def run(
    arguments: argparse.Namespace,
    *,
    fmu: Callable[[str], Path],
    read_gains: "ReadGains",
    read_model: "ReadModel | None" = None,
) -> int:
    """Run, or replay; returns the exit status.

    Args:
        arguments: as `add_arguments` declares them.
        fmu: makes the FMU of a model, for the emulated bench.
        read_gains: reads a gains file.
        read_model: reads which model the controller of a gains file follows; None for the PID block alone.

    Returns:
        0; 1 for a run that tripped, results that could not be written or a replay that differs; 3 when the output could
        not be confirmed off; 130 after an interrupt, with the output off.

    Raises:
        InputError: bad settings or files, no camera, another instrument at the address.
        RunError: no supply, no tip.
    """
    if arguments.action == "replay":
        return _replay(arguments)
    if arguments.action == "recover":
        return _recover(arguments)
    if arguments.action == "nexus":
        return _nexus(arguments)
    if arguments.run_directory is not None:
        raise InputError(
            f"found {str(arguments.run_directory)!r}, expected replay, recover or nexus before a directory"
        )

    from bender_hil.runner.interrupts import Interrupted, Interrupts

    with Interrupts() as interrupts:
        try:
            if getattr(arguments, "learn", None) is not None:
                return _learn(arguments, interrupts, fmu, read_gains, read_model)
            return _run(arguments, interrupts, fmu, read_gains, read_model)
        except Interrupted as error:
            _complain(
                f"interrupted by {error} before the supply was armed; nothing was switched on, nothing is written"
            )
            return INTERRUPTED


def _run(
    arguments: argparse.Namespace,
    interrupts: "Interrupts",
    fmu: Callable[[str], Path],
    read_gains: "ReadGains",
    read_model: "ReadModel | None",
) -> int:
    from bender_hil.guard.guard import Status
    from bender_hil.guard.start import OutputUnknownError
    from bender_hil.log.ending import EndOfRun
    from bender_hil.log.results import write_results
    from bender_hil.runner.run import run as run_bench
    from bender_hil.runner.run_lock import sole_run_with_note
    from bender_loop.shell.progress import Progress
    from bender_loop.shell.run import step

    bench = _bench(arguments)
    program = make_program(arguments, bench, read_gains)
    _name_folder(arguments, "hil")
    try:
        with (
            followed(arguments, bench, program, read_model) as program,
            sole_run_with_note(bench.address, arguments.out, _complain),
            watched(arguments) as page,
            Progress("run") as progress,
        ):
            show = _shown(progress, round(program.duration_s * bench.rate_Hz))
            seen = show if page is None else both(page.see, show)
            result = run_bench(
                bench, program, arguments.out, fmu=fmu, witness=seen, interrupts=interrupts, stop=page, tell=step
            )
    except OutputUnknownError as error:
        _complain(str(error))
        return Status.UNCONFIRMED
    ended = result.ended
    end = EndOfRun(ended.code, ended.sentence, ended.alarm, result.signal)
    results = write_results(result.directory, result.log, result.record, end)
    status, complaints = _judged(result)
    unwritten = [*result.unwritten, *results.unwritten]
    if unwritten:
        status = status or int(Status.TRIPPED)
        complaints.append(f"not everything could be written: {'; '.join(unwritten)}")
    return _show_results(results, complaints, status)


def _bench(arguments: argparse.Namespace) -> "BenchFile":
    from bender_hil.bench_file import emulated_bench, read_bench

    return emulated_bench() if arguments.bench is None else read_bench(arguments.bench)


def _name_folder(arguments: argparse.Namespace, what: str) -> None:
    """Name the folder of a run by its time where nobody named one."""
    if arguments.out is None:
        arguments.out = _free_name(Path("results") / f"{what}-{datetime.now().astimezone():%Y%m%d-%H%M%S}")


def _learn(
    arguments: argparse.Namespace,
    interrupts: "Interrupts",
    fmu: Callable[[str], Path],
    read_gains: "ReadGains",
    read_model: "ReadModel | None",
) -> int:
    """Run a profile again and again; returns the status of the pass that was ended, else 0."""
    from bender_hil.learning import learn_on_bench

    bench = _bench(arguments)
    model = None if read_model is None else read_model(_gains_path(arguments, bench))
    if model is None:
        raise InputError("--learn learns through a model; name gains that have one (bender tune --follow-model)")
    _name_folder(arguments, "learn")
    dead_time_s = model.dead_time_s
    return learn_on_bench(arguments, bench, lambda x: _run(x, interrupts, fmu, read_gains, read_model), dead_time_s)


def _judged(result: "RunResult") -> tuple[int, list[str]]:
    """Return the status of a run and what is to complain about; an alarm is said by whoever has the last word."""
    from bender_hil.guard.guard import Status

    ended = result.ended
    if ended.status is Status.UNCONFIRMED:
        return int(Status.UNCONFIRMED), []
    if result.interrupted:
        return INTERRUPTED, [f"interrupted, the output is off; the run is in {result.directory}"]
    if ended.code is not None:
        return int(Status.TRIPPED), [f"the run was ended ({ended.code}), the output is off: {ended.sentence}"]
    return 0, []


@contextlib.contextmanager
def watched(arguments: argparse.Namespace) -> "Iterator[LiveSession | None]":
    """Serve the page of a run or an investigation while the context lasts; None where nobody asked for it."""
    if not getattr(arguments, "watch", False):
        yield None
        return
    from bender_hil.live.session import LiveSession

    with LiveSession(arguments.out) as session:
        sys.stdout.write(f"watch: {session.url}\n")
        sys.stdout.flush()
        yield session


@contextlib.contextmanager
def followed(
    arguments: argparse.Namespace, bench: "BenchFile", program: "Program", read_model: "ReadModel | None"
) -> "Iterator[Program]":
    """Yield the programme with the model that its gains name, or as it is where they name none.

    Raises:
        InputError: the model's FMU is missing, or not the one that was tuned with.
    """
    from bender_hil.runner.program import ClosedLoop

    words = vars(arguments)
    controller, alone = words.get("controller"), words.get("open_loop", False)
    if not isinstance(program, ClosedLoop):
        if controller is not None or alone:
            raise InputError("--controller and --open-loop follow set-points; found a profile of voltages")
        yield program
        return
    rate_Hz, path = bench.rate_Hz, _gains_path(arguments, bench)
    if controller is not None:
        from bender_hil.runner.foreign_program import foreign_loop

        if alone or words.get("gains") is not None:
            raise InputError("--controller brings its own law; leave out --gains and --open-loop")
        with foreign_loop(program, controller, rate_Hz) as foreign:
            yield foreign
        return
    model = None if read_model is None or words.get("no_model", False) else read_model(path)
    if model is None:
        if alone:
            raise InputError(f"{path}: names no model, which --open-loop inverts; see bender tune --follow-model")
        yield program
        return
    from bender_hil.runner.following_program import expected_error_um, extrapolation, following

    preview = arguments.profile is not None and not words.get("no_preview", False)
    if alone:
        program.gains = replace(
            program.gains, proportional_V_per_um=0.0, integral_V_per_um_s=0.0, derivative_V_s_per_um=0.0
        )
    with following(program, model, path.parent / model.fmu, rate_Hz, preview=preview) as found:
        if said := extrapolation(found):
            sys.stderr.write(f"note: {said}\n")
        if alone:
            known = f"{model.rms_um:.3g} µm of it what the model missed" if model.rms_um else "a right model assumed"
            sys.stdout.write(f"open loop: expected error {expected_error_um(found):.3g} µm rms, {known}\n")
        yield found


def both(first: "Witness", second: "Witness") -> "Witness":
    """Return a witness that shows a sight to two of them."""

    def show(sight: "Sight") -> None:
        first(sight)
        second(sight)

    return show


def _buffered(reference: "Voltages", bench: "BenchFile") -> "Program":
    from bender_hil.runner.buffered import Buffered

    return Buffered(reference, bench.rate_Hz)


def make_program(arguments: argparse.Namespace, bench: "BenchFile", read_gains: "ReadGains") -> "Program":
    """What the words on the command line ask for.

    Raises:
        InputError: a profile or gains file is not fit, or a number out of its range.
    """
    from bender_hil.runner.program import ClosedLoop, OpenLoop
    from bender_hil.runner.voltages import LONGEST_S, SINE_V, Voltages, read_profile_file
    from bender_loop.control.pid import Limits
    from bender_loop.control.references import Step

    duration_s = arguments.duration
    if duration_s is not None and not 0.0 < duration_s <= LONGEST_S:
        raise InputError(f"--duration: found {duration_s!r}, expected seconds above 0, at most {LONGEST_S:g}")
    both, buffered = bench.guard.minimum_V <= -SINE_V, getattr(arguments, "buffered", False)
    reference = None if arguments.profile is None else read_profile_file(arguments.profile, both_polarities=both)
    if isinstance(reference, Voltages):
        if arguments.duration is not None or arguments.gains is not None:
            raise InputError("--duration and --gains belong to the closed loop; a voltage profile has its own length")
        _within(reference.levels_V, bench)
        return _buffered(reference, bench) if buffered else OpenLoop(reference)
    if buffered:
        raise InputError("--buffered plays a profile of voltages; name one with --profile")
    setpoint_um = SETPOINT_UM if arguments.setpoint is None else arguments.setpoint
    levels = (setpoint_um,) if reference is None else reference.setpoints_um
    low_um, high_um = bench.guard.travel_um
    for level in levels:
        if not low_um <= level <= high_um:
            raise InputError(
                f"setpoint: found {level!r} µm, expected a place within the travel, {low_um:g} ... {high_um:g}"
            )
    path = _gains_path(arguments, bench)
    gains, limits, period_s = read_gains(path)
    _note_unsuited(arguments, bench, path, period_s)
    guard = bench.guard
    _check_gains(path, gains, limits)
    lower_V, upper_V = max(guard.minimum_V, limits.lower_V), min(guard.maximum_V, limits.upper_V)
    if not lower_V < upper_V:
        raise InputError(
            f"{path}: limits: found {limits.lower_V:g} ... {limits.upper_V:g} V, which has nothing in common with "
            f"what the guard allows, {guard.minimum_V:g} ... {guard.maximum_V:g} V"
        )
    limits = Limits(lower_V, upper_V, limits.tracking_time_s)
    if duration_s is None:
        duration_s = DURATION_S if reference is None else max(reference.times_s[-1] + 1.0, 1.0)
    step = Step(setpoint_um) if reference is None else reference
    return ClosedLoop(step, gains, limits, SLEW_SHARE * bench.guard.slew_V_per_s, duration_s)


def _show_results(results: "Results", complaints: list[str], status: int) -> int:
    """Print the figures; returns the exit status: a good run whose figures cannot be printed has failed to say so."""
    from bender_loop.shell.progress import print_table

    try:
        print_table(results.title, ["what", "found"], results.rows)
        names = ", ".join(results.written) or "nothing"
        sys.stdout.write(f"written: {results.directory} ({names})\n{results.line}\n")
        sys.stdout.flush()
    except BrokenPipeError:
        if not status:
            raise
    except OSError as error:
        status = status or FAILED
        complaints = [*complaints, f"the figures cannot be printed ({error.strerror}); they are in {results.directory}"]
        _forget_standard_output()
    for complaint in complaints:
        _complain(complaint)
    return status


def _forget_standard_output() -> None:
    """Let what waits to be printed go nowhere, instead of failing once more when the process ends."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain(sentence: str) -> None:
    """Write one line to the standard error; a terminal that has gone is no reason to fail."""
    with contextlib.suppress(OSError):
        sys.stderr.write(f"bender: {' '.join(sentence.split())}\n")
        sys.stderr.flush()


def _free_name(path: Path) -> Path:
    """The path, or the first of path-2, path-3 … that is not there."""
    return next(name for k in count(1) if not (name := path if k == 1 else path.with_name(f"{path.name}-{k}")).exists())


def _shown(progress: "Progress", frames: int) -> "Witness":
    """What shows a run's progress twice a second, after the command of that frame has gone.

    A terminal that has gone, or a pipe that nobody reads, does not end a run.
    """
    seen = 0

    def show(sight: "Sight") -> None:
        nonlocal seen
        seen += 1
        with contextlib.suppress(OSError):
            if seen % _FRAMES_SHOWN:
                return
            progress.update(seen, frames, "no tip" if sight.tip_um is None else f"{sight.tip_um:.2f} µm")

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


def _recover(arguments: argparse.Namespace) -> int:
    from bender_hil.log.results import recover

    if arguments.run_directory is None:
        raise InputError("recover: name the directory of a run")
    results = recover(arguments.run_directory)
    if results.unwritten:
        raise InputError("; ".join(results.unwritten))
    return _show_results(results, [], 0)


def _nexus(arguments: argparse.Namespace) -> int:
    from bender_hil.log.nexus import write_nexus

    if arguments.run_directory is None:
        raise InputError("nexus: name the directory of a run")
    out = write_nexus(arguments.run_directory, arguments.out)
    sys.stdout.write(f"written: {out}\n")
    return 0


def _check_gains(path: Path, gains: "Gains", limits: "Limits") -> None:
    """Refuse gains with which the arithmetic of the loop would overflow before it says anything."""
    numbers = {name: getattr(gains, name) for name in gains.__dataclass_fields__}
    numbers["tracking_time_s"] = limits.tracking_time_s
    for name, value in numbers.items():
        if value > LARGEST_GAIN:
            raise InputError(f"{path}: {name}: found {value:g}, expected at most {LARGEST_GAIN:g}")


def _note_unsuited(arguments: argparse.Namespace, bench: "BenchFile", path: Path, period_s: float) -> None:
    """Say of gains that they are another device's, or those of another rate."""
    rate = f"{bench.rate_Hz:.3g}"
    is_ours = path == OWN_GAINS and arguments.gains is None and not vars(arguments).get("controller")
    if is_ours and bench.emulator is None:
        sys.stderr.write(
            "note: without --gains the gains are those of the paper's actuator; for those of your device: "
            f"`bender tune --model model.toml --rate {rate}`, with a model that `bender diagnose` or "
            "`bender model fit` wrote\n"
        )
    elif not 0.8 <= period_s * bench.rate_Hz <= 1.25:
        sys.stderr.write(
            f"note: {path} was tuned for {1.0 / period_s:.3g} readings per second, the bench gives {rate}; "
            f"`bender tune --rate {rate}` tunes for it\n"
        )


def _gains_path(arguments: argparse.Namespace, bench: "BenchFile") -> Path:
    if arguments.gains is not None:
        return arguments.gains
    return OWN_GAINS if bench.controller.gains is None else bench.resolve(bench.controller.gains)


def _within(levels_V: tuple[float, ...], bench: "BenchFile") -> None:
    lowest_V, highest_V = bench.guard.minimum_V, bench.guard.maximum_V
    for level_V in levels_V:
        if not lowest_V <= level_V <= highest_V:
            raise InputError(f"--profile: found {level_V!r} V, the guard allows {lowest_V:g} ... {highest_V:g} V")
