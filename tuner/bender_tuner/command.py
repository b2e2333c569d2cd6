"""`bender tune`: the PID block tuned against any co-simulation FMU (FMI 2.0 or 3.0) with one input and one output."""

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bender_loop.fmu.start_values import add_set_argument, start_values
from bender_loop.records.arguments import OneAtATime
from bender_tuner.optimisers.methods import DEFAULT_BUDGET, METHODS
from bender_tuner.task.settings import GAIN_UNITS, OBJECTIVES, RULES, WEIGHTS, TuneSettings, make_settings

if TYPE_CHECKING:
    from bender_tuner.task.session import Session

HELP = "tune the PID controller in simulation against an FMU, ours or yours"
EXAMPLE = """\
bender tune
bender tune --fmu mine.fmu --input voltage --output displacement --units V,mm --setpoint 10 --seed 7
bender tune --method zn --out results/zn
bender tune --max-overshoot 0.5 --max-ms 1.5 --settle-within 0.6
bender tune --weight effort=1 --weight overshoot=10
bender tune --bounds kp=0.01:0.5 ki=1:20
bender tune --compare pso,differential_evolution --monte-carlo 300
bender tune --fmu diagnosis/model.fmu --follow-model    # a controller that uses the corrected model
bender tune --method bas_printed    # the paper's search on the paper's objective"""

INTERRUPTED, FAILED = 130, 1
DEFAULT_LIMITS_V = (0.0, 50.0)
"""Of the command, where nobody says others."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare everything but the model, which only the command line knows."""
    _add_plant(parser)
    add_set_argument(parser)
    _add_method(parser)
    _add_loop(parser)
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: results/tune, with a number where it exists")


def run(
    arguments: argparse.Namespace,
    model: str | None = None,
    fmu_of: Callable[[str | Path], Path] | None = None,
    lacking_of: Callable[[str | Path], Sequence[tuple[str, Path]]] | None = None,
) -> int:
    """Tune, write gains.toml, tuning.json and pictures, print the table.

    Args:
        arguments: as `add_arguments` declares them.
        model: what to tune where `--fmu` is not given, a built-in name or a file.
        fmu_of: makes the FMU of a model.
        lacking_of: makes FMUs of a model, or of the one in an FMU, without one of its effects each, with the effects.

    Returns:
        0; 130 after an interrupt and 1 after a failure of the plant, both with the best gains so far written.

    Raises:
        InputError: bad settings, FMU, variables, setpoint or directory; nothing was written.
        RunError: the plant failed, or no gains were found under which the loop holds.
        KeyboardInterrupt: before there was anything to keep.
    """
    from bender_loop.errors import InputError
    from bender_loop.shell.files import unused

    settings = settings_from(arguments)
    if arguments.out is None:
        arguments.out = unused(Path("results") / "tune")
    from bender_loop.fmu.diagnosed import diagnosed
    from bender_loop.tables.quantities import USUAL, of_input_and_output
    from bender_tuner.task.session import hold_session

    path, found = arguments.fmu, diagnosed(arguments.fmu or model)
    if path is None:
        if model is None or fmu_of is None:
            raise InputError("no FMU was named; say which one to tune with --fmu FILE")
        path, found = fmu_of(model), found.with_fmus_of(fmu_of)
    doubted, subject = (), arguments.fmu or model
    if arguments.follow_model and not found.vouched_for and lacking_of is not None and subject is not None:
        doubted = lacking_of(subject)
    session = hold_session(
        path,
        arguments.input,
        arguments.output,
        settings,
        arguments.out,
        foreign=arguments.fmu is not None,
        parameters=start_values(arguments),
        quantities=USUAL if arguments.units is None else of_input_and_output(arguments.units),
        follow_model=arguments.follow_model,
        found=found,
        doubted=doubted,
    )
    return _status(session, arguments.out)


def settings_from(arguments: argparse.Namespace) -> TuneSettings:
    """The settings that the words on the command line stand for; InputError where they make no sense."""
    lower_V, upper_V = arguments.voltage_limits or DEFAULT_LIMITS_V
    iterations = arguments.iterations
    return make_settings(
        method=arguments.method,
        objective=arguments.objective,
        setpoint_um=arguments.setpoint,
        rate_Hz=arguments.rate,
        latency_frames=arguments.latency,
        exposure_s=arguments.exposure,
        noise_um=arguments.noise,
        duration_s=arguments.duration,
        lower_V=lower_V,
        upper_V=upper_V,
        slew_V_per_s=arguments.slew,
        evaluations=arguments.evaluations if iterations is None else 1 + 3 * iterations,
        seed=arguments.seed,
        monte_carlo=arguments.monte_carlo,
        compare=tuple(arguments.compare),
        max_ms=arguments.max_ms,
        max_overshoot_percent=arguments.max_overshoot,
        settle_within_s=arguments.settle_within,
        max_noise_gain_V_per_um=arguments.max_noise_gain,
        gain_error_percent=arguments.gain_error,
        late_frames=arguments.late_frames,
        decades=arguments.decades,
        weights=tuple(arguments.weight),
        gain_bounds=tuple(arguments.bounds),
    )


def _status(session: "Session", out: Path) -> int:
    if session.ended.value == "complete":
        return 0
    if session.ended.value == "refused":
        sys.stderr.write(f"bender: no gains were written: {session.reason}\n")
        return FAILED
    searched = session.searches[-1] if session.searches else None
    after = f" after {len(searched.history)} of {searched.budget} evaluations of {searched.method}" if searched else ""
    kept = f"the best gains so far are in {session.place(out, 'gains.toml')}"
    if session.partial:
        kept += f"; {out / 'gains.toml'} is of an earlier run"
    if session.ended.value == "interrupted":
        sys.stderr.write(f"bender: interrupted{after}; {kept}\n")
        return INTERRUPTED
    sys.stderr.write(f"bender: {' '.join(session.reason.split())}; this came{after or ' later'}, {kept}\n")
    return FAILED


def _add_plant(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--fmu",
        type=Path,
        metavar="FILE",
        help="a co-simulation FMU (FMI 2.0, 3.0), native code that runs with your rights (default: built from --model)",
    )
    parser.add_argument(
        "--input",
        action=OneAtATime,
        metavar="NAME",
        help="voltage input of the FMU (default: its only input, or `voltage`)",
    )
    parser.add_argument(
        "--output",
        action=OneAtATime,
        metavar="NAME",
        help="displacement output of the FMU (default: its only output, or `displacement`)",
    )
    parser.add_argument(
        "--units",
        metavar="IN,OUT",
        help="of input and output, as V,um where the FMU declares none (default: V,m); others, as W,K, stand for "
        "V and µm in every option",
    )
    parser.add_argument(
        "--voltage-limits",
        nargs=2,
        type=_number,
        metavar=("LOW", "HIGH"),
        help="bounds of the command in V (default: 0 50; with a --model of another device than a piezo bender, what it "
        "was learned from)",
    )
    parser.add_argument(
        "--slew", type=_number, metavar="V_PER_S", help="limit on the rate of the command (default: none)"
    )


def _add_method(parser: argparse.ArgumentParser) -> None:
    about = {name: info.description for name, info in METHODS.items()} | RULES
    width = max(map(len, about))
    parser.add_argument_group("methods", "\n".join(f"{name:<{width}}  {words}" for name, words in about.items()))
    parser.add_argument("--method", default="reliable_bas", metavar="METHOD", help="see below (default: reliable_bas)")
    parser.add_argument(
        "--follow-model",
        action="store_true",
        help="tune a model-following controller too: the model inverted, the PID block on measured minus predicted",
    )
    parser.add_argument(
        "--compare",
        type=lambda text: text.split(","),
        default=(),
        metavar="METHOD,...",
        help=f"also tune with these, same budget, in one table ({', '.join(RULES)} are always in it)",
    )
    parser.add_argument(
        "--objective",
        metavar="NAME",
        help=f"{', '.join(OBJECTIVES)} (default: practitioner; mse, the paper's, with --method bas_printed)",
    )
    parser.add_argument(
        "--max-ms",
        type=_number,
        metavar="MS",
        help="bound of the sensitivity peak over gain and latency (default: 1.7)",
    )
    parser.add_argument(
        "--max-overshoot", type=_number, metavar="PERCENT", help="bound of the nominal overshoot (default: 2)"
    )
    parser.add_argument(
        "--settle-within", type=_number, metavar="S", help="bound of the nominal settling time, to 2 %% (default: none)"
    )
    parser.add_argument(
        "--max-noise-gain", type=_number, metavar="V_PER_UM",
        help="bound of the noise of the command per noise of the reading (default: none)",
    )  # fmt: skip
    parser.add_argument(
        "--gain-error", type=_number, metavar="PERCENT",
        help="the gain of the device may be off by so much either way (default: gains hold for 30; whether a model is "
        "followed is decided by what its diagnosis leaves open)",
    )  # fmt: skip
    parser.add_argument(
        "--late-frames", type=int, metavar="FRAMES",
        help="a frame may come so many frames later than --latency says; 0 where one clock times the loop (default: 1, "
        "or as --gain-error)",
    )  # fmt: skip
    parser.add_argument(
        "--decades", type=_number, metavar="D",
        help="gains are searched so many powers of ten either side of the first guess (default: 1.5)",
    )  # fmt: skip
    parser.add_argument(
        "--bounds", type=_bounds, nargs="+", action="extend", default=[], metavar="GAIN=LOW:HIGH",
        help=f"search these gains ({', '.join(f'{x} in {unit}' for x, unit in GAIN_UNITS.items())}) between bounds, "
        "in place of --decades",
    )  # fmt: skip
    parser.add_argument(
        "--weight", type=_weight, action="append", default=[], metavar="NAME=VALUE",
        help=f"weight in the practitioner's objective: {', '.join(WEIGHTS)} (0 to 1, against the mean)",
    )  # fmt: skip
    parser.add_argument("--seed", type=_whole, default=0, metavar="N", help="the same seed gives the same gains")
    budget = parser.add_mutually_exclusive_group()
    budget.add_argument(
        "--iterations", type=_whole, metavar="N", help="iterations of the optimiser: 3 N + 1 evaluations"
    )
    budget.add_argument(
        "--evaluations", type=_whole, default=DEFAULT_BUDGET, metavar="N", help=f"default: {DEFAULT_BUDGET}"
    )
    parser.add_argument(
        "--monte-carlo", type=_whole, default=0, metavar="N", help="test the gains on N randomly drawn plants"
    )


def _add_loop(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--setpoint", type=_number, default=10.0, metavar="UM", help="height of the step (default: 10)")
    parser.add_argument("--rate", type=_number, metavar="HZ", help="frames per second (default: 30; 100 with mse)")
    parser.add_argument(
        "--latency",
        type=_whole,
        metavar="FRAMES",
        help="age of a frame when the controller uses it (default: 1; 0 with mse)",
    )
    parser.add_argument(
        "--exposure",
        type=_number,
        metavar="S",
        help="a frame is the mean over it (default: 0.015, at most 45 %% of the period; 0 with mse and below 3.3 Hz)",
    )
    parser.add_argument(
        "--noise", type=_number, default=0.0, metavar="UM", help="standard deviation of the reading in µm (default: 0)"
    )
    parser.add_argument("--duration", type=_number, metavar="S", help="length of a run (default: 2, or 60 frames)")


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"found {text!r}, expected a finite number")
    return value


def _weight(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"found {text!r}, expected NAME=VALUE")
    return name.strip(), _number(value)


def _bounds(text: str) -> tuple[str, float, float]:
    name, equals, ends = text.partition("=")
    low, colon, high = ends.partition(":")
    if not equals or not colon:
        raise argparse.ArgumentTypeError(f"found {text!r}, expected GAIN=LOW:HIGH, as in kp=0.01:0.5")
    return name.strip().lower(), _number(low), _number(high)


def _whole(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"found {text!r}, expected a whole number >= 0")
    return value
