"""`bender benchmark identify`: what the identification is held to, claim by claim."""

import argparse
import sys
from pathlib import Path

HELP = "what `bender identify` is held to: errors on unseen input, recovery of (30), what it refuses"

LONGEST = 32


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how many seeds the claims with noise get, and where the results go."""
    parser.add_argument("--seeds", type=int, default=5, metavar="N", help="seeds of each claim with noise (default: 5)")


def run(arguments: argparse.Namespace) -> int:
    """Print the table, write identify.json."""
    from dataclasses import asdict

    from bender_loop.errors import InputError
    from bender_loop.shell.files import prepare_directory, write_result
    from bender_loop.shell.progress import Progress, print_table
    from bender_studies.benchmarks.identify_claims import claims
    from bender_studies.reproduction.shared_work import SharedWork

    if arguments.seeds < 1:
        raise InputError(f"--seeds: found {arguments.seeds}, expected 1 or more")
    out: Path = prepare_directory(arguments.out)
    shared, found = SharedWork(out), []
    _ = shared.fmus
    with Progress("identify benchmark, claims") as progress:
        for claim in claims(shared, range(arguments.seeds)):
            found.append(claim)
            progress.update(len(found), None, claim.what)
    write_result(out / "identify.json", {"claims": [asdict(claim) for claim in found]})
    met = {True: "yes", False: "NO", None: "not tried"}
    rows = [[c.what, c.bound, _short(c.found), met[c.met]] for c in found]
    print_table("What the identification is held to", ("claim", "held to", "found", "met"), rows)
    words = [f"{c.what}: {c.found}" for c in found if isinstance(c.found, str) and len(c.found) > LONGEST]
    sys.stdout.write("".join(f"{line}\n" for line in ["", *words, ""]))
    sys.stdout.write(f"written: {out / 'identify.json'}\n")
    return 0


def _short(found: float | str) -> str:
    """A figure, or words that fit into a table; longer ones stand below it."""
    if not isinstance(found, str):
        return f"{found:.4g}"
    return found if len(found) <= LONGEST else "see below"
