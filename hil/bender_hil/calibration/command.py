"""`bender calibrate`: what a pixel is worth, from pictures of a stage micrometer, or a sensor's volt, from points."""

import argparse
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bender_hil.calibration.fit import RulerFit
    from bender_hil.calibration.pictures import Picture

HELP = "find the scale in µm per pixel from pictures of a stage micrometer, or per volt of a sensor from points"
EXAMPLE = """\
bender calibrate ruler-along.png ruler-across.png --out bench/calibration.toml
bender calibrate --camera 0 --frames 30 --pitch-um 10 --ruler-uncertainty-percent 0.05
bender calibrate --sensor 0.512:0 4.487:100 --unit V --reference-um 0.5 --out sensor.toml
bender calibrate --emulated"""

_DISAGREE_PARTS = 1e-3
_STRONG_DISTORTION_PARTS = 2e-3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare where the pictures come from, the ruler, and where the result goes."""
    parser.add_argument(
        "picture", type=Path, nargs="*", metavar="PICTURE", help="picture of the ruler; lines in any direction"
    )
    parser.add_argument(
        "--camera", metavar="SOURCE", help="take pictures with this camera: device number, file, or address of a stream"
    )
    parser.add_argument("--frames", type=int, default=20, metavar="N", help="number of frames to average (default: 20)")
    parser.add_argument(
        "--sensor", nargs="+", metavar="POINT",
        help="calibrate a sensor that is no camera: READING:UM twice or more, or a CSV file with reading and "
        "displacement_um",
    )  # fmt: skip
    parser.add_argument("--unit", default="V", metavar="NAME", help="unit of the sensor's readings (default: V)")
    parser.add_argument(
        "--reference-um", type=float, default=0.0, metavar="UM",
        help="standard uncertainty of each known displacement in µm (default: 0, unknown)",
    )  # fmt: skip
    parser.add_argument("--degree", type=int, default=1, metavar="N", help="of the sensor's curve (default: 1, a line)")
    parser.add_argument("--emulated", action="store_true", help="calibrate the microscope of the emulated bench")
    parser.add_argument(
        "--pitch-um", type=float, default=10.0, metavar="UM", help="pitch of the lines in µm (default: 10)"
    )
    parser.add_argument(
        "--ruler-uncertainty-percent", type=float, default=0.0, metavar="PERCENT",
        help="standard uncertainty of the ruler, from its certificate (default: 0, unknown)",
    )  # fmt: skip
    parser.add_argument(
        "--out", type=Path, default=Path("calibration.toml"), metavar="FILE",
        help="the result; a picture of the fit goes beside it, of a sensor where the extra pictures is installed "
        "(default: calibration.toml)",
    )  # fmt: skip
    parser.add_argument("--force", action="store_true", help="replace a calibration that is there")


def run(arguments: argparse.Namespace) -> int:
    """Print the result, write it with a marked picture beside it; returns the exit status.

    Raises:
        InputError: nothing to look at, a picture that shows no ruler, or a value out of its bounds.
        RunError: the camera sends no frames.
    """
    from bender_hil.calibration.fit import fit_ruler
    from bender_hil.calibration.fringes import find_fringes
    from bender_hil.calibration.pictures import marked
    from bender_loop.shell.files import prepare_directory, write_atomically
    from bender_loop.shell.run import answer

    if arguments.sensor:
        from bender_hil.calibration.sensor_command import calibrate_sensor

        return calibrate_sensor(arguments)
    _refuse_bad_values(arguments)
    pictures = _pictures(arguments)
    names = ", ".join(pictures)
    fringes = [find_fringes(picture, name) for name, picture in pictures.items()]
    fit = fit_ruler(fringes, arguments.pitch_um, arguments.ruler_uncertainty_percent / 100.0, names)
    out: Path = arguments.out
    picture = marked(list(pictures.values()), fit)
    prepare_directory(out.parent)
    write_atomically(out.with_suffix(".png"), picture)
    fit.calibration.save(out)
    answer(asdict(fit.calibration) | {"places": fit.places, "written": [str(out), str(out.with_suffix(".png"))]})
    _print(fit, list(pictures), arguments.ruler_uncertainty_percent)
    sys.stdout.write(f"written: {out}, {out.with_suffix('.png')}\n")
    return 0


def _refuse_bad_values(arguments: argparse.Namespace) -> None:
    import math

    from bender_loop.errors import InputError

    asked = [bool(arguments.picture), arguments.camera is not None, arguments.emulated]
    if sum(asked) != 1:
        raise InputError("pictures: expected one of PICTURE..., --camera SOURCE, --sensor POINT..., --emulated")
    if not (math.isfinite(arguments.pitch_um) and arguments.pitch_um > 0.0):
        raise InputError(f"--pitch-um: found {arguments.pitch_um}, expected more than 0")
    if not 0.0 <= arguments.ruler_uncertainty_percent < 10.0:
        raise InputError(f"--ruler-uncertainty-percent: found {arguments.ruler_uncertainty_percent}, expected 0 to 10")
    if not 1 <= arguments.frames <= 10_000:
        raise InputError(f"--frames: found {arguments.frames}, expected 1 to 10000")
    refuse_bad_out(arguments)


def refuse_bad_out(arguments: argparse.Namespace) -> None:
    """Refuse a name for the result that is no TOML file's, or is taken; InputError."""
    from bender_loop.errors import InputError

    if arguments.out.suffix != ".toml":
        raise InputError(f"--out: found {arguments.out}, expected a name that ends in .toml")
    if arguments.out.exists() and not arguments.force:
        raise InputError(f"{arguments.out}: found a file there, expected none: give another name by --out, or --force")


def _pictures(arguments: argparse.Namespace) -> "dict[str, Picture]":
    from bender_hil.calibration.pictures import draw_pictures, read_picture, take_picture

    if arguments.emulated:
        along, across = draw_pictures(seed=1)
        return {"emulated ruler along": along, "emulated ruler across": across}
    if arguments.camera is not None:
        return {f"camera {arguments.camera}": take_picture(arguments.camera, arguments.frames)}
    return {str(path): read_picture(path) for path in arguments.picture}


def _print(fit: "RulerFit", names: list[str], ruler_percent: float) -> None:
    from bender_loop.shell.progress import print_table

    found = fit.calibration
    percent = 100.0 * found.uncertainty / found.um_per_px
    rows: list[list[str | float | int | None]] = [
        ["scale", f"{found.um_per_px:.6f}", "µm/px"],
        ["standard uncertainty", f"{percent:.4f}", "%"],
        ["distortion at the corner", f"{100.0 * found.distortion:+.3f}", "%"],
        ["residual", f"{found.residual_um:.4f}", "µm rms"],
        ["places used", fit.places, ""],
    ]
    for name, angle, lone in zip(names, fit.angles_deg, fit.lone_um_per_px, strict=True):
        rows.append([f"{name}, {angle:.2f} deg", f"{lone:.6f}", "µm/px"])
    print_table("Calibration", ("what", "value", "unit"), rows)
    for warning in _warnings(fit, ruler_percent):
        sys.stdout.write(f"{warning}\n")


def _warnings(fit: "RulerFit", ruler_percent: float) -> list[str]:
    found, said = fit.calibration, []
    apart = max(fit.lone_um_per_px) / min(fit.lone_um_per_px) - 1.0
    if apart > _DISAGREE_PARTS:
        said.append(
            f"note: the pictures disagree by {100.0 * apart:.2f} %: tilted ruler, moved focus, or pixels that are not"
            " square; take pictures along the tip's motion only"
        )
    if abs(found.distortion) > _STRONG_DISTORTION_PARTS:
        said.append("note: the lens distorts; the tip is corrected for it, so keep zoom and camera where they are")
    if ruler_percent == 0.0:
        said.append("note: the uncertainty leaves out the ruler itself; add its own with --ruler-uncertainty-percent")
    return said
