"""`bender benchmark fuzz`: mutated inputs through the FMUs, and bad inputs through every command."""

import argparse
import sys
from dataclasses import fields
from pathlib import Path

HELP = (
    "10 000 mutated inputs: values, steps, legal call orders, damaged archives; 10 000 records in every format; then "
    "1 000 bad inputs through every command; no crash, no traceback, no silent NaN, no hang, no file left"
)
FAILED = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how many, from which seed, and where the result goes."""
    parser.add_argument("--cases", type=int, default=10_000, metavar="N", help="mutated, 0 for none (default: 10000)")
    parser.add_argument(
        "--tables", type=int, default=10_000, metavar="N", help="records in other formats, 0 for none (default: 10000)"
    )
    parser.add_argument(
        "--inputs", type=int, default=1000, metavar="N", help="bad, through every command, 60 s each (default: 1000)"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="the same seed gives the same inputs")
    parser.add_argument("--processes", type=int, default=2, metavar="N", help="at a time (default: 2)")
    parser.add_argument("--out", type=Path, metavar="DIR", default=Path("results/benchmark-fuzz"))


def run(arguments: argparse.Namespace) -> int:
    """Run both campaigns, print the complaints, write fuzz.json; returns 1 when there are any."""
    from bender_export.build import ensure_controller_fmu, ensure_plant_fmu
    from bender_loop.errors import InputError
    from bender_loop.shell.files import prepare_directory, write_result
    from bender_loop.shell.progress import Progress
    from bender_studies.fuzzing.campaign import run_campaign
    from bender_studies.fuzzing.hostile_campaign import Tally, try_inputs

    for name, least in (("cases", 10), ("tables", 1), ("inputs", 1), ("processes", 1)):
        found = getattr(arguments, name)
        if found < least and not (found == 0 and name != "processes"):
            raise InputError(f"--{name}: found {found}, expected at least {least}")
    out: Path = prepare_directory(arguments.out)
    fmus = {
        "paper": ensure_plant_fmu("paper"),
        "bench": ensure_plant_fmu("bench"),
        "controller": ensure_controller_fmu(),
    }
    complaints: list[str] = []
    if arguments.cases or arguments.tables:
        with Progress("mutated inputs") as progress:
            count, seed, processes = arguments.cases, arguments.seed, arguments.processes
            complaints = run_campaign(fmus, count, seed, processes, progress.update, arguments.tables)
    tally = Tally()
    if arguments.inputs:
        with Progress("bad inputs") as progress:
            tally = try_inputs(fmus["paper"], arguments.inputs, arguments.seed, arguments.processes, progress.update)
    for complaint in [*complaints, *tally.complaints]:
        sys.stdout.write(f"{complaint}\n")
    inputs = {x.name: getattr(tally, x.name) for x in fields(tally)}
    asked = {name: getattr(arguments, name) for name in ("cases", "tables", "seed")}
    facts = {**asked, "complaints": complaints, "inputs": inputs}
    write_result(out / "fuzz.json", facts)
    sys.stdout.write(
        f"{arguments.cases} mutated inputs and {arguments.tables} records in other formats from seed {arguments.seed}: "
        f"{len(complaints)} complaints\n"
        f"{tally.tried} bad inputs: {tally.statuses['2']} refused, {len(tally.faults)} faults, "
        f"{len(tally.hangs)} hangs, {len(tally.left)} left files behind\n"
        f"written: {out / 'fuzz.json'}\n"
    )
    return FAILED if complaints or tally.complaints else 0
