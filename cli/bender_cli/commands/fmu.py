"""`bender fmu check FILE`, `build` and `controller`: what is wrong with an FMU, and FMUs of this project."""

import argparse
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from bender_loop.errors import InputError
from bender_loop.records.arguments import OneAtATime
from bender_loop.shell.run import answer, remark

if TYPE_CHECKING:
    from collections.abc import Iterable

    from bender_export.system import Loop
    from bender_loop.fmu.check.check import Report

HELP = "check an FMU against the standard, or build the FMUs of this project"
EXAMPLE = """\
bender fmu check fmu/PiezoBender.fmu
bender fmu build --model beam --out results/fmu
bender fmu build --gains results/tune/gains.toml --out results/fmu
bender fmu controller results/retuned/gains.toml --out results/fmu
bender fmu build --native --fmi 3 --platforms all --out results/fmu
bender fmu compile other.fmu --out other-here.fmu
bender fmu linearise --model paper --voltage 10 --out results/linear.json
bender fmu linearise --fmu oven.fmu --input heater --output plate --voltage 200 --out results/oven.json"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the actions and their arguments."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    check = actions.add_parser(
        "check",
        help="run every available check and explain each finding; exit status 1 on an error or a warning",
    )
    check.add_argument("file", type=Path, metavar="FILE", help="an FMU of FMI 1.0, 2.0 or 3.0")
    check.add_argument("--no-run", action="store_true", help="read the FMU without running it")
    build = actions.add_parser("build", help="build the plant FMU, the controller FMU and the closed loop (SSP)")
    build.add_argument(
        "--model", default="paper", metavar="MODEL", help="model file or built-in model (default: paper)"
    )
    build.add_argument(
        "--gains", type=Path, metavar="FILE", help="gains.toml of `bender tune`, for controller and loop"
    )
    build.add_argument("--out", type=Path, default=Path("fmu"), metavar="DIR", help="output directory (default: fmu)")
    _add_native(build)
    following = actions.add_parser(
        "controller", help="build the model-following controller of a gains file as an FMU, and its closed loop (SSP)"
    )
    following.add_argument(
        "gains", type=Path, metavar="GAINS", help="gains.toml of `bender tune --follow-model`, its model beside it"
    )
    following.add_argument(
        "--out", type=Path, default=Path("fmu"), metavar="DIR", help="output directory (default: fmu)"
    )
    following.add_argument(
        "--latency", type=int, default=0, metavar="N",
        help="age of a measurement when the host hands it over, in samples (default: 0; in the SSP always 1)",
    )  # fmt: skip
    following.add_argument(
        "--command-delay", type=float, default=0.0, metavar="S",
        help="from a measurement until its command acts (default: 0; `bender hil`: 0.004)",
    )  # fmt: skip
    _add_native(following)
    own = actions.add_parser("compile", help="compile the C sources that an FMU carries, for this machine")
    own.add_argument("file", type=Path, metavar="FILE", help="an FMU of FMI 2.0 or 3.0 with sources")
    own.add_argument(
        "--out", type=Path, metavar="FILE", help="the copy with a binary (default: FILE with -here before .fmu)"
    )
    _add_linearise(actions.add_parser("linearise", help="write A, B, C, D of a plant at an operating point"))


def _add_native(made: argparse.ArgumentParser) -> None:
    made.add_argument("--native", action="store_true", help="without Python inside: the same kernels as C")
    made.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="3 with --native only (default: 2)")
    made.add_argument(
        "--platforms", nargs="+", metavar="NAME",
        help="with --native: all, none, or some of linux64 win64 aarch64-linux aarch64-darwin darwin64",
    )  # fmt: skip


def _add_linearise(linear: argparse.ArgumentParser) -> None:
    linear.add_argument("--model", metavar="MODEL", help="model file or built-in model (default: paper)")
    linear.add_argument("--fmu", type=Path, metavar="FILE", help="any co-simulation FMU instead of a model")
    linear.add_argument("--input", action=OneAtATime, metavar="NAME", help="input of the FMU (default: its only one)")
    linear.add_argument("--output", action=OneAtATime, metavar="NAME", help="output of the FMU (default: its only one)")
    linear.add_argument(
        "--units", metavar="IN,OUT", help="units of input and output where the FMU declares none, as W,K"
    )
    linear.add_argument(
        "--voltage", type=float, default=0.0, metavar="V", help="input at the operating point, in its unit (default: 0)"
    )
    linear.add_argument(
        "--change", type=float, metavar="V",
        help="step of the FMU's input, up and down (default: 1 %% of the operating point, at least 0.01)",
    )  # fmt: skip
    linear.add_argument(
        "--step", type=float, metavar="S",
        help="sampling time (default: 0.001; of an FMU that of its default experiment)",
    )  # fmt: skip
    linear.add_argument(
        "--settle", type=float, metavar="S",
        help="time before and after the step (default: 10, or the default experiment of the FMU)",
    )  # fmt: skip
    linear.add_argument(
        "--out", type=Path, default=Path("linear.json"), metavar="FILE",
        help=".json or .npz (default: linear.json); of an FMU a picture stands beside it",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Print the findings; returns 1 when there are any.

    Raises:
        InputError: the file is missing or is not an FMU; there is no such model.
    """
    if arguments.action == "build":
        return _build(arguments)
    if arguments.action == "controller":
        return _build_following(arguments)
    if arguments.action == "linearise":
        return _linearise(arguments)
    if arguments.action == "compile":
        return _compile(arguments)
    from bender_loop.fmu.check.check import check

    report = check(arguments.file, trial=not arguments.no_run)
    answer({"file": str(arguments.file)} | asdict(report))
    _print(arguments.file, report)
    return 1 if report.faults else 0


def _build(arguments: argparse.Namespace) -> int:
    from bender_export.build import PLANT_FMU, build_all

    loop = None
    if arguments.gains is not None:
        from bender_export.system import loop_of
        from bender_loop.tables.quantities import USUAL
        from bender_tuner.results.gains_file import read_gains, read_units

        loop, units = loop_of(*read_gains(arguments.gains)), read_units(arguments.gains) or USUAL[:2]
        if units != USUAL[:2]:
            return _build_in_units(arguments, loop, units)
    if arguments.native:
        return _build_native(arguments, loop)
    _require_native(arguments)
    return _print_written(build_all(arguments.model, arguments.out / PLANT_FMU, arguments.out, loop))


def _build_in_units(arguments: argparse.Namespace, loop: "Loop", units: tuple[str, str]) -> int:
    from bender_export.build import build_controller_in_units
    from bender_report.wording import unit_text

    said = " and ".join(unit_text(x) for x in units)
    if arguments.native:
        raise InputError(
            f"{arguments.gains}: found gains in {said} with --native, expected no --native; or remove [units] and feed "
            f"the FMU with {unit_text(units[1])} times 1e-6"
        )
    _require_native(arguments)
    path = build_controller_in_units(loop, units, arguments.out)
    remark(
        f"note: the controller takes and gives {said}; no plant and no loop of this project's device are written "
        "beside it: connect it with your own FMU in your tool, or run both by bender simulate"
    )
    return _print_written([path])


def _build_native(arguments: argparse.Namespace, loop: "Loop | None") -> int:
    from bender_export.build import PLANT_FMU
    from bender_native.build import build_native, way

    made = way(arguments.fmi, arguments.platforms)
    paths = build_native(arguments.model, arguments.out / PLANT_FMU, arguments.out, made, loop)
    if made.note is not None:
        remark(f"note: {made.note}")
    return _print_written(paths)


def _build_following(arguments: argparse.Namespace) -> int:
    from bender_export.following import Host, Tuned, build_following
    from bender_tuner.results.gains_file import read_controller

    path: Path = arguments.gains
    gains, limits, period_s, model = read_controller(path)
    if model is None:
        raise InputError(
            f"{path}: found no [model_following], expected a model to follow; write one by bender tune "
            f"--follow-model, or build the loop of the PID block by bender fmu build --gains {path}"
        )
    host = Host(arguments.latency, arguments.command_delay)
    fmu, makers = path.parent / model.fmu, None
    _require_native(arguments)
    if arguments.native:
        from bender_native.build import native_makers, way

        made = way(arguments.fmi, arguments.platforms)
        makers = native_makers(made)
        if made.note is not None:
            remark(f"note: {made.note}")
    return _print_written(build_following(Tuned(gains, limits, period_s, model), fmu, arguments.out, host, makers))


def _require_native(arguments: argparse.Namespace) -> None:
    if not arguments.native and (arguments.fmi != 2 or arguments.platforms):
        raise InputError("--fmi 3 and --platforms: found without --native, expected with it")


def _print_written(paths: "Iterable[Path]") -> int:
    """Print what was written."""
    names = [str(path) for path in paths]
    answer({"written": names})
    sys.stdout.writelines(f"{name}\n" for name in names)
    return 0


def _compile(arguments: argparse.Namespace) -> int:
    from bender_native.foreign import compile_fmu

    out: Path = arguments.out or arguments.file.with_name(f"{arguments.file.stem}-here.fmu")
    remark("note: the sources are compiled as they are; what comes out is native code")
    return _print_written([compile_fmu(arguments.file, out)])


def _linearise(arguments: argparse.Namespace) -> int:
    from bender_native.linearise import linearised, write_linear

    if arguments.fmu is not None:
        return _linearise_fmu(arguments)
    if any(x is not None for x in (arguments.input, arguments.output, arguments.units, arguments.change)):
        raise InputError("--input, --output, --units, --change: found without --fmu, expected with it")
    step_s, settle_s = (x if x is not None else y for x, y in ((arguments.step, 0.001), (arguments.settle, 10.0)))
    linear = linearised(arguments.model or "paper", arguments.voltage, step_s, settle_s)
    write_linear(linear, arguments.out)
    for note in linear.notes:
        remark(f"note: {note}")
    return _print_written([arguments.out])


def _linearise_fmu(arguments: argparse.Namespace) -> int:
    from bender_loop.shell.files import prepare_directory, write_atomically
    from bender_loop.tables.quantities import USUAL, of_input_and_output
    from bender_native.linearise import table_content
    from bender_report.drawing import can_draw, no_pictures
    from bender_report.wording import quantity, shown_in
    from bender_tuner.model.linearised_fmu import LinearisationRequest, linearised_fmu
    from bender_tuner.pictures.plant import draw_plant

    if arguments.model is not None:
        raise InputError("--fmu and --model both name a plant; give only one")
    given = USUAL if arguments.units is None else of_input_and_output(arguments.units)
    asked = LinearisationRequest(
        arguments.voltage, arguments.input, arguments.output, arguments.step, arguments.settle, arguments.change, given
    )
    picture = arguments.out.with_suffix(".png")
    content_of = table_content(arguments.out)
    linear = linearised_fmu(arguments.fmu, asked)
    (taken, shown), (commanded, read) = linear.names, linear.units
    with shown_in(commanded, read):
        point = linear.point
        rest = quantity(point.voltage_V, "V", 4), quantity(point.displacement_um, "um", 4)
        at = f"{taken} {rest[0]}, {shown} {rest[1]}"
        said = f"linear about {at}, from {taken} to {shown}"
        drawn = draw_plant(linear.model, arguments.fmu.stem, said) if can_draw() else None
    content = content_of(linear.table())
    prepare_directory(arguments.out.parent)
    write_atomically(arguments.out, content)
    for note in (*linear.notes, *([no_pictures()] if drawn is None else [])):
        remark(f"note: {note}")
    if drawn is None:
        return _print_written([arguments.out])
    write_atomically(picture, drawn)
    return _print_written([arguments.out, picture])


def _print(path: Path, report: "Report") -> None:
    from bender_loop.fmu.check.findings import SEVERITIES

    for finding in sorted(report.findings, key=lambda finding: SEVERITIES.index(finding.severity)):
        sys.stdout.write(f"{path}: {finding.severity}: {finding.what}\n")
        sys.stdout.write(f"    why: {finding.why}\n    do:  {finding.remedy}\n")
    sys.stdout.write(f"{path}: checked: {', '.join(report.ran)}\n")
    for reason in report.left_out:
        sys.stdout.write(f"{path}: left out: {reason}\n")
    notes = len(report.findings) - len(report.faults)
    ending = f", {notes} note{'s' if notes > 1 else ''}" if notes else ""
    count = len(report.faults)
    found = f"{count} finding{'s' if count > 1 else ''}" if count else "no findings"
    sys.stdout.write(f"{path}: {found}{ending}\n")
