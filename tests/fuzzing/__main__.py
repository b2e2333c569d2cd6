"""`python -m fuzzing --inputs 1000 --seed 7`, in `tests/`: bad inputs through every command, and what came of them."""

import argparse
import sys

from bender_export.build import ensure_plant_fmu
from fuzzing.hostile_campaign import Tally, try_inputs


def main() -> int:
    """Try the inputs; print the complaints as they come, then the counts; return 1 where there are complaints."""
    parser = argparse.ArgumentParser(prog="python -m fuzzing", description=__doc__)
    parser.add_argument("--inputs", type=int, default=100, metavar="N")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="the same seed, the same inputs")
    parser.add_argument("--processes", type=int, default=1, metavar="N", help="at a time (default: 1)")
    parser.add_argument("--only", type=int, nargs="+", metavar="K", help="these inputs of the seed alone")
    parser.add_argument("--failed", action="store_true", help="print what was said with exit status 1 as well")
    asked = parser.parse_args()
    shown: set[str] = set()

    def tell(tally: Tally, of: int) -> None:
        for line in [*tally.complaints, *(tally.failed if asked.failed else [])]:
            if line not in shown:
                shown.add(line)
                sys.stdout.write(f"{line}\n")
                sys.stdout.flush()
        if tally.tried % 20 == 0:
            sys.stderr.write(f"{tally.tried} of {of}\n")

    tally = try_inputs(ensure_plant_fmu("paper"), asked.inputs, asked.seed, asked.processes, tell, only=asked.only)
    counts = ", ".join(f"{status}: {count}" for status, count in sorted(tally.statuses.items()))
    sys.stdout.write(
        f"{tally.tried} inputs; exit statuses {counts}; {len(tally.faults)} faults, {len(tally.hangs)} without an end, "
        f"{len(tally.left)} with files left, {len(tally.noise)} with noise\n"
    )
    return int(bool(tally.complaints))


if __name__ == "__main__":
    sys.exit(main())
