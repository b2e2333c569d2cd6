"""`bender benchmark vision`: errors of the tip and of the scale against drawn truth, and time."""

import argparse
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bender_loop.shell.progress import Cell
    from bender_studies.vision.accuracy import Errors
    from bender_studies.vision.scale import ScaleErrors

HELP = "errors of the tip in clean and bad pictures, error of the scale"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how many pictures, and where the results go."""
    parser.add_argument("--frames", type=int, default=500, metavar="N", help="pictures of each case (default: 500)")
    parser.add_argument("--rulers", type=int, default=10, metavar="N", help="pictures of each ruler (default: 10)")
    parser.add_argument("--seed", type=int, default=1, metavar="N")


def run(arguments: argparse.Namespace) -> int:
    """Print the tables with their limits, write vision.json."""
    from bender_loop.errors import InputError
    from bender_loop.shell.files import finite, prepare_directory, write_result
    from bender_loop.shell.opencv import import_cv2

    for name in ("frames", "rulers"):
        if getattr(arguments, name) < 1:
            raise InputError(f"--{name}: found {getattr(arguments, name)}, expected 1 or more")
    if arguments.seed < 0:
        raise InputError(f"--seed: found {arguments.seed}, expected 0 or more")
    import_cv2()
    out = prepare_directory(arguments.out)
    settings = {"frames": arguments.frames, "seed": arguments.seed}
    write_result(out / "vision.json", finite({"settings": settings, **_accuracy(arguments), **_scale(arguments)}))
    sys.stdout.write(f"written: {out / 'vision.json'}\n")
    return 0


def _accuracy(arguments: argparse.Namespace) -> dict[str, object]:
    from bender_loop.shell.progress import Progress, print_table
    from bender_studies.vision.accuracy import measure_case
    from bender_studies.vision.cases import CASES
    from bender_vision.settings import EXTREME, LINE

    found: dict[str, dict[str, Errors]] = {}
    with Progress("tip") as progress:
        for done, (name, case) in enumerate(CASES.items()):
            progress.update(done, len(CASES))
            found[name] = {
                method: measure_case(case, method, arguments.frames, arguments.seed) for method in (LINE, EXTREME)
            }
    columns = (
        "case", "bias px", "rms px", "max px", "limit", "met", "lost", "median ms", "p99 ms", "p99 cpu ms",
        "extreme: bias px", "rms px", "far off",
    )  # fmt: skip
    rows: list[list[Cell]] = []
    for name, case in CASES.items():
        line, extreme = found[name][LINE], found[name][EXTREME]
        met = "yes" if line.rms_px <= case.limit_px else "NO"
        rows.append([
            name, f"{line.bias_px:+.3f}", f"{line.rms_px:.3f}", f"{line.max_px:.3f}", case.limit_px, met, line.lost,
            f"{line.median_ms:.2f}", f"{line.p99_ms:.2f}", f"{line.p99_cpu_ms:.2f}",
            f"{extreme.bias_px:+.2f}", f"{extreme.rms_px:.2f}", extreme.far_off,
        ])  # fmt: skip
    print_table(f"Tip against the truth, {arguments.frames} pictures each", columns, rows)
    sys.stdout.writelines(f"{name}: {case.what}\n" for name, case in CASES.items())
    return {"tip": {name: {method: asdict(one) for method, one in both.items()} for name, both in found.items()}}


def _scale(arguments: argparse.Namespace) -> dict[str, object]:
    from bender_loop.shell.progress import Progress, print_table
    from bender_studies.vision.scale import ALLOWED_PERCENT, SCALE_CASES, measure_scale

    found: dict[str, ScaleErrors] = {}
    with Progress("scale") as progress:
        for done, (name, changes) in enumerate(SCALE_CASES.items()):
            progress.update(done, len(SCALE_CASES))
            found[name] = measure_scale(changes, arguments.rulers, arguments.seed)
    rows: list[list[Cell]] = [
        [
            name, f"{one.rms_percent:.4f}", f"{one.max_percent:.4f}", ALLOWED_PERCENT,
            "yes" if one.max_percent <= ALLOWED_PERCENT else "NO",
            f"{one.claimed_percent:.4f}", f"{one.distortion_max_percent:.3f}",
        ]
        for name, one in found.items()
    ]  # fmt: skip
    columns = ("case", "rms %", "max %", "limit", "met", "claimed %", "distortion max %")
    print_table(f"Error of the scale, {arguments.rulers} rulers each", columns, rows)
    return {"scale": {name: asdict(one) for name, one in found.items()}}
