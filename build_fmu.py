"""Write the FMUs of this project, the plant and its controller, and the closed loop of both (SSP)."""

import argparse
import os
import signal
import sys
from pathlib import Path
from typing import NoReturn

ROOT = Path(__file__).resolve().parent


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
    # a reader that has seen enough (| head) is no error
    signal.signal(getattr(signal, "SIGPIPE", signal.SIGTERM), signal.SIG_DFL)
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
        for path in build_all(arguments.model, arguments.out, _controller_folder(arguments.out)):
            sys.stdout.write(f"{path}\n")
    except (InputError, RunError) as problem:
        sys.stderr.write(f"build_fmu.py: {problem}\n")
        return 2 if isinstance(problem, InputError) else 1
    except KeyboardInterrupt:
        sys.stderr.write("build_fmu.py: interrupted\n")
        return 130
    reason = unsupported()
    if reason is not None:
        sys.stderr.write(f"build_fmu.py: note: {reason}\n")
    return 0


def _native(arguments: argparse.Namespace) -> int:
    from bender_native.build import build_native, way

    made = way(arguments.fmi, arguments.platforms)
    for path in build_native(arguments.model, arguments.out, _controller_folder(arguments.out), made):
        sys.stdout.write(f"{path}\n")
    if made.note is not None:
        sys.stderr.write(f"build_fmu.py: note: {made.note}\n")
    return 0


def _controller_folder(plant_out: Path) -> Path:
    """Return where the controller FMU goes: `fmu/`, or beside the plant FMU where that cannot be written."""
    own = ROOT / "fmu"
    return own if os.access(own if own.exists() else ROOT, os.W_OK) else plant_out.parent


if __name__ == "__main__":
    sys.exit(main())
