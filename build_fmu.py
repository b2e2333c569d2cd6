"""Write the FMUs of this project, the plant and its controller, and the closed loop of both (SSP)."""

import argparse
import os
import sys
from pathlib import Path
from typing import NoReturn

ROOT = Path(__file__).resolve().parent
PIPE_CLOSED = 141


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message} (see: {self.prog} --help)\n")


def main(argv: list[str] | None = None) -> int:
    """Build them; returns the exit status (0 done, 1 the run failed, 2 bad input)."""
    parser = _Parser(prog="build_fmu.py", description=__doc__)
    parser.add_argument(
        "--model", default="paper", metavar="MODEL", help="built-in model (paper, beam, bench) or a model file"
    )
    parser.add_argument(
        "--out", type=Path, default=ROOT / "fmu" / "PiezoBender.fmu", metavar="FILE", help="name of the plant FMU"
    )
    parser.add_argument(
        "--native", action="store_true", help="without Python inside: the same kernels as C, compiled and as sources"
    )
    parser.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="version of FMI, 3 with --native only")
    parser.add_argument(
        "--platforms", nargs="+", metavar="NAME",
        help="with --native: all, none, or some of linux64 win64 aarch64-linux aarch64-darwin darwin64",
    )  # fmt: skip
    arguments = parser.parse_args(argv)
    if not arguments.native and (arguments.fmi != 2 or arguments.platforms):
        parser.error("--fmi 3 and --platforms go with --native")
    try:
        from bender_export.build import build_all
        from bender_export.platform_support import unsupported
        from bender_loop.errors import InputError, RunError
    except ModuleNotFoundError as missing:
        sys.stderr.write(f"build_fmu.py: {missing}; install the project first: pip install -e {ROOT}\n")
        return 2
    try:
        if arguments.native:
            return _native(arguments)
        written = build_all(arguments.model, arguments.out, _controller_folder(arguments.out))
        sys.stdout.write("".join(f"{path}\n" for path in written))
        sys.stdout.flush()
    except (InputError, RunError) as problem:
        sys.stderr.write(f"build_fmu.py: {problem}\n")
        return 2 if isinstance(problem, InputError) else 1
    except KeyboardInterrupt:
        sys.stderr.write("build_fmu.py: interrupted\n")
        return 130
    except BrokenPipeError:  # the files are there; only the reader of their names has left
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return PIPE_CLOSED
    reason = unsupported()
    if reason is not None:
        sys.stderr.write(f"build_fmu.py: note: {reason}\n")
    return 0


def _native(arguments: argparse.Namespace) -> int:
    from bender_native.build import build_native, way

    made = way(arguments.fmi, arguments.platforms)
    written = build_native(arguments.model, arguments.out, arguments.out.parent, made)
    sys.stdout.write("".join(f"{path}\n" for path in written))
    sys.stdout.flush()
    if made.note is not None:
        sys.stderr.write(f"build_fmu.py: note: {made.note}\n")
    return 0


def _controller_folder(plant_out: Path) -> Path:
    """Return `fmu/` of the checkout, or the plant's folder where the checkout cannot be written."""
    folder = ROOT / "fmu"
    nearest = next(place for place in (folder, *folder.parents) if place.exists())
    return folder if nearest.is_dir() and os.access(nearest, os.W_OK) else plant_out.parent


if __name__ == "__main__":
    sys.exit(main())
