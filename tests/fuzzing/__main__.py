"""`python -m fuzzing --inputs 1000 --seed 7`, in `tests/`: bad inputs through every command, and what came of them."""

import argparse
import sys

from bender_export.build import ensure_plant_fmu
from fuzzing.device_campaign import try_devices
from fuzzing.hostile_campaign import Tally, try_inputs


def main() -> int:
    """Try the inputs; print the complaints as they come, then the counts; return 1 where there are complaints."""
    parser = argparse.ArgumentParser(prog="python -m fuzzing", description=__doc__)
    parser.add_argument("--inputs", type=int, default=100, metavar="N")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="the same seed, the same inputs")
    parser.add_argument("--processes", type=int, default=1, metavar="N", help="at a time (default: 1)")
    parser.add_argument("--only", type=int, nargs="+", metavar="K", help="these inputs of the seed alone")
    parser.add_argument("--failed", action="store_true", help="print what was said with exit status 1 as well")
    parser.add_argument("--devices", type=int, metavar="N", help="instead: N devices drawn at random, each diagnosed")
    asked = parser.parse_args()
    if asked.devices is not None:
        return _devices(asked.devices, asked.seed, asked.processes)
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


def _devices(count: int, seed: int, processes: int) -> int:
    tried = []
    for device in try_devices(count, seed, processes):
        tried.append(device)
        sys.stdout.writelines(f"{line}\n" for line in device.complaints)
        sys.stdout.flush()
    faults = sum(len(x.faults) + len(x.hangs) + len(x.noise) for x in tried)
    names, false = sum(len(x.certain) for x in tried), sum(len(x.false) for x in tried)
    worse = sum(x.worse is not None for x in tried)
    sys.stdout.write(
        f"{len(tried)} devices from seed {seed}: {faults} faults, hangs or lines of noise, {false} of {names} certain "
        f"names false, {worse} corrected models worse\n"
    )
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
