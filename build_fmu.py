"""Write the FMUs of this project, the plant and its controller, and the closed loop of both (SSP)."""

import argparse
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
    arguments = parser.parse_args(argv)
    try:
        from bender_export.build import build_all
        from bender_export.platform_support import unsupported
        from bender_loop.errors import InputError, RunError
    except ModuleNotFoundError as missing:
        sys.stderr.write(f"build_fmu.py: {missing}; install the project first: pip install -e {ROOT}\n")
        return 2
    try:
        for path in build_all(arguments.model, arguments.out, ROOT / "fmu"):
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


if __name__ == "__main__":
    sys.exit(main())
