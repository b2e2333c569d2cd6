"""`bender benchmark constants`: each constant that decides what is said, a part smaller and larger."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bender_studies.hidden_effects.constants import Compared

HELP = "how many verdicts change with each constant of `bender diagnose`, a fifth smaller and larger"
KINDS: tuple[str, ...] = ("singles", "nothing")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare which cases are diagnosed, by how much constants change, and where the results go."""
    parser.add_argument("--seeds", type=int, default=1, metavar="N", help="cases of each kind (default: 1)")
    parser.add_argument(
        "--nothing-seeds", type=int, default=20, metavar="N", help="cases in which nothing is hidden (default: 20)"
    )
    parser.add_argument("--first-seed", type=int, default=1, metavar="N", help="seed of the first case (default: 1)")
    parser.add_argument(
        "--kinds", nargs="+", metavar="KIND", help=f"as of the benchmark discrepancy ({' '.join(KINDS)})"
    )
    parser.add_argument("--each", type=int, default=1, metavar="N", help="only every N-th case (default: 1)")
    parser.add_argument("--part", type=float, default=0.2, help="relative change of each constant (default: 0.2)")
    parser.add_argument("--jobs", type=int, metavar="N", help="parallel processes (default: one per processor)")


def run(arguments: argparse.Namespace) -> int:
    """Print the table and a row for each other verdict, write constants.json; an interrupt keeps what is done."""
    import tempfile
    from itertools import islice

    from bender_loop.errors import InputError
    from bender_loop.shell.files import prepare_directory
    from bender_proving import SELECTIONS, cases
    from bender_studies.hidden_effects.constants import compared
    from bender_studies.runner import check_known, check_least, collected

    kinds, first = list(arguments.kinds or KINDS), arguments.first_seed
    check_known("--kinds", kinds, SELECTIONS)
    check_least(arguments, 1, "seeds", "nothing_seeds", "each", "jobs")
    check_least(arguments, 0, "first_seed")
    if not 0.0 < arguments.part < 1.0:
        raise InputError(f"--part: found {arguments.part:g}, expected more than 0 and less than 1")
    prepare_directory(arguments.out)
    drawn = (
        case
        for kind in kinds
        for count in [arguments.nothing_seeds if kind in ("nothing", "starts") else arguments.seeds]
        for case in cases(kind, range(first, first + count))
    )
    with tempfile.TemporaryDirectory() as folder:
        verdicts = compared(islice(drawn, 0, None, arguments.each), Path(folder), arguments.jobs, arguments.part)
        found, status = collected(
            verdicts, "constants, verdicts", lambda x: f"{x.changed.name} {x.changed.value:g}: {x.after.in_words}"
        )
    if found:
        _tell(arguments, kinds, found)
    return status


def _tell(arguments: argparse.Namespace, kinds: list[str], found: "list[Compared]") -> None:
    from dataclasses import asdict

    from bender_loop.shell.progress import print_table
    from bender_studies.hidden_effects.constants import totals
    from bender_studies.runner import write_facts

    print_table("Verdicts that change", ("constant", "value", "cases", "other verdict", "part"), totals(found))
    other = [
        [x.changed.name, f"{x.changed.value:g}", " + ".join(x.truth) or "nothing", x.before.in_words, x.after.in_words]
        for x in found
        if x.differs
    ]
    if other:
        print_table("Other verdicts", ("constant", "value", "hidden", "as it is", "changed"), other)
    settings = {"kinds": kinds, "first_seed": arguments.first_seed, "part": arguments.part}
    write_facts(arguments.out / "constants.json", {**settings, "verdicts": [asdict(x) for x in found]})
