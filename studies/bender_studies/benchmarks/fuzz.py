"""`bender benchmark fuzz`: mutated inputs through the FMUs, `bender fmu check` and `bender tune`."""

import argparse
import json
import sys
from pathlib import Path

HELP = (
    "10 000 mutated inputs: values, steps, legal call orders, damaged archives; no crash, no traceback, no silent NaN"
)
FAILED = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how many, from which seed, and where the result goes."""
    parser.add_argument("--cases", type=int, default=10_000, metavar="N", help="(default: 10000)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="the same seed gives the same inputs")
    parser.add_argument("--processes", type=int, default=2, metavar="N", help="at a time (default: 2)")
    parser.add_argument("--out", type=Path, metavar="DIR", default=Path("results/benchmark-fuzz"))


def run(arguments: argparse.Namespace) -> int:
    """Run the campaign, print the complaints, write fuzz.json; returns 1 when there are any."""
    from bender_export.build import ensure_controller_fmu, ensure_plant_fmu
    from bender_loop.errors import InputError
    from bender_loop.shell.files import prepare_directory, write_atomically
    from bender_loop.shell.progress import Progress
    from bender_studies.fuzzing.campaign import run_campaign

    for name, least in (("cases", 10), ("processes", 1)):
        if getattr(arguments, name) < least:
            raise InputError(f"--{name}: found {getattr(arguments, name)}, expected at least {least}")
    out: Path = prepare_directory(arguments.out)
    fmus = {
        "paper": ensure_plant_fmu("paper"),
        "bench": ensure_plant_fmu("bench"),
        "controller": ensure_controller_fmu(),
    }
    with Progress("mutated inputs") as progress:
        complaints = run_campaign(fmus, arguments.cases, arguments.seed, arguments.processes, progress.update)
    for complaint in complaints:
        sys.stdout.write(f"{complaint}\n")
    facts = {"cases": arguments.cases, "seed": arguments.seed, "complaints": complaints}
    write_atomically(out / "fuzz.json", json.dumps(facts, indent=2) + "\n")
    sys.stdout.write(
        f"{arguments.cases} mutated inputs from seed {arguments.seed}: {len(complaints)} complaints\n"
        f"written: {out / 'fuzz.json'}\n"
    )
    return FAILED if complaints else 0
