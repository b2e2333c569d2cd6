"""`bender benchmark fuzz`: devices drawn at random through `bender model fit` and `bender diagnose`."""

import argparse
import sys
from dataclasses import asdict
from pathlib import Path

HELP = (
    "devices drawn at random, with uneven clocks, gaps, outliers, other units and loops, through a first model and a "
    "diagnosis: faults, hangs, noise of libraries, false certain names, worse models"
)
FAILED, INTERRUPTED = 1, 130


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how many, from which seed, and where the result goes."""
    parser.add_argument("--devices", type=int, default=100, metavar="N", help="120 s each at most (default: 100)")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="of the first; the same seed, the same device")
    parser.add_argument("--processes", type=int, default=2, metavar="N", help="at a time (default: 2)")


def run(arguments: argparse.Namespace) -> int:
    """Print what should not be, and the counts; write devices.json; returns 1 for a fault, a hang or noise.

    An interrupt keeps the devices that are done.
    """
    from collections import Counter
    from contextlib import closing

    from bender_loop.errors import InputError
    from bender_loop.shell.files import prepare_directory, write_result
    from bender_loop.shell.progress import Progress, print_table
    from bender_studies.device_fuzz.campaign import Tried, try_devices

    for name in ("devices", "processes"):
        if getattr(arguments, name) < 1:
            raise InputError(f"--{name}: found {getattr(arguments, name)}, expected at least 1")
    out: Path = prepare_directory(arguments.out)
    tried: list[Tried] = []
    status = 0
    with (
        Progress("devices") as progress,
        closing(try_devices(arguments.devices, arguments.seed, arguments.processes)) as devices,
    ):
        try:
            for device in devices:
                tried.append(device)
                progress.update(len(tried), arguments.devices)
        except KeyboardInterrupt:
            status = INTERRUPTED
    for complaint in (complaint for x in tried for complaint in x.complaints):
        sys.stdout.write(f"{complaint}\n")
    counts = {
        "devices": len(tried),
        "seed": arguments.seed,
        "outcomes": dict(sorted(Counter(x.outcome or "none" for x in tried).items())),
        "faults": sum(len(x.faults) for x in tried),
        "hangs": sum(len(x.hangs) for x in tried),
        "lines_of_noise": sum(len(x.noise) for x in tried),
        "certain_names": sum(len(x.certain) for x in tried),
        "false_certain_names": sum(len(x.false) for x in tried),
        "worse_models": sum(x.worse is not None for x in tried),
    }
    write_result(out / "devices.json", counts | {"tried": [asdict(x) for x in tried]})
    rows = [[name.replace("_", " "), x] for name, x in counts.items() if isinstance(x, int) and name != "seed"]
    print_table("Devices drawn at random", ("what", "found"), rows)
    sys.stdout.write(f"written: {out / 'devices.json'}\n")
    return status or (FAILED if counts["faults"] or counts["hangs"] or counts["lines_of_noise"] else 0)
