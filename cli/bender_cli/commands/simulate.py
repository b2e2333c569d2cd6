"""`bender simulate MODEL|FMU --gains FILE`: a closed loop in simulation, with any gains and any reference."""

import argparse
import sys
from pathlib import Path

from bender_loop.fmu.start_values import add_set_argument
from bender_loop.records.arguments import OneAtATime

HELP = "simulate a closed loop: a model or FMU, a gains file, a reference"
EXAMPLE = """\
bender simulate paper --gains results/tune/gains.toml --setpoint 12
bender simulate diagnosis/model.toml --gains results/tune/gains.toml --profile scan.csv
bender simulate mine.fmu --gains gains.toml --profile scan.csv --preview --out results/scan"""
FILES = ("loop.json", "loop.csv", "loop.png")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the plant, the controller, the reference and the camera."""
    parser.add_argument("plant", metavar="MODEL|FMU", help="model file, built-in model (paper, beam, bench), or an FMU")
    parser.add_argument("--gains", type=Path, required=True, metavar="FILE", help="gains.toml of `bender tune`")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--profile", type=Path, metavar="FILE", help="CSV with time_s and setpoint_um")
    what.add_argument("--setpoint", type=float, metavar="UM", help="height of a step (default: 10)")
    parser.add_argument("--duration", type=float, metavar="S", help="default: 150 frames, or the profile and 60 frames")
    parser.add_argument(
        "--input", action=OneAtATime, metavar="NAME", help="input of the FMU (default: its only one, or `voltage`)"
    )
    parser.add_argument(
        "--output",
        action=OneAtATime,
        metavar="NAME",
        help="output of the FMU (default: its only one, or `displacement`)",
    )
    parser.add_argument(
        "--units", metavar="IN,OUT", help="units of input and output where the FMU declares none (default: V,m)"
    )
    add_set_argument(parser)
    parser.add_argument("--latency", type=int, metavar="FRAMES", help="age of a frame in the loop (default: 1)")
    parser.add_argument("--noise", type=float, metavar="UM", help="standard deviation of the reading (default: 0)")
    parser.add_argument("--slew", type=float, metavar="V_PER_S", help="limit on the rate of the command")
    parser.add_argument(
        "--no-model", action="store_true", help="run the PID block alone even if the gains name a model"
    )
    parser.add_argument(
        "--preview", action="store_true", help="let a model-following controller see the reference in advance"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the noise")
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: results/simulate, with a number")


def run(arguments: argparse.Namespace) -> int:
    """Print the figures, write loop.json, loop.csv and loop.png; 1 for a loop that runs away.

    Raises:
        InputError: the plant, the gains or the reference will not do.
        RunError: the plant failed.
    """
    from bender_loop.fmu.start_values import start_values
    from bender_loop.shell.files import check_directory, keep_earlier, unused
    from bender_loop.shell.progress import print_table
    from piezo_bender.loops import figures_table, how_seen, simulate_loop

    if arguments.out is None:
        arguments.out = unused(Path("results") / "simulate")
    check_directory(arguments.out)
    is_fmu = arguments.plant.lower().endswith(".fmu")
    found = simulate_loop(
        arguments.gains,
        None if is_fmu else arguments.plant,
        fmu=Path(arguments.plant) if is_fmu else None,
        profile=arguments.profile,
        setpoint_um=arguments.setpoint,
        duration_s=arguments.duration,
        input_name=arguments.input,
        output_name=arguments.output,
        units=arguments.units,
        parameters=start_values(arguments),
        follow_model=not arguments.no_model,
        preview=arguments.preview,
        latency_frames=arguments.latency,
        noise_um=arguments.noise,
        slew_V_per_s=arguments.slew,
        seed=arguments.seed,
    )
    if found.trace.diverged:
        sys.stderr.write(f"bender: the loop runs away with {arguments.gains}; nothing was written\n")
        return 1
    keep_earlier(arguments.out, FILES[0], FILES[1:])
    found.save(arguments.out)
    columns, rows = figures_table(found)
    print_table(f"{found.controller} on {found.subject}", columns, rows)
    sys.stdout.write(f"{how_seen(found)}\n")
    names = ", ".join(str(arguments.out / name) for name in FILES)
    sys.stdout.write(f"written: {names}\n")
    return 0
