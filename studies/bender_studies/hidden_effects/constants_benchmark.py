"""`bender benchmark constants`: each constant that decides what is said, a part smaller and larger."""

import argparse
import sys
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
    """Print the table, and a row for each verdict that differs; write constants.json. An interrupt keeps what is done.

    Raises:
        InputError: a kind is not known, or a number is out of range.
    """
    import os
    import tempfile
    from itertools import islice

    from bender_loop.shell.files import prepare_directory
    from bender_loop.shell.progress import Progress
    from bender_proving import cases
    from bender_studies.hidden_effects.constants import compared

    kinds = _checked(arguments)
    prepare_directory(arguments.out)
    first, found, status = arguments.first_seed, [], 0
    drawn = (
        case
        for kind in kinds
        for count in [arguments.nothing_seeds if kind in ("nothing", "starts") else arguments.seeds]
        for case in cases(kind, range(first, first + count))
    )
    with tempfile.TemporaryDirectory() as folder, Progress("constants, verdicts") as bar:
        try:
            chosen, jobs = islice(drawn, 0, None, arguments.each), arguments.jobs or os.cpu_count() or 1

            def tell(how_far: str) -> None:
                bar.update(0, None, how_far)

            for x in compared(chosen, Path(folder), jobs, arguments.part, tell):
                found.append(x)
                bar.update(len(found), None, f"{x.changed.name} {x.changed.value:g}: {x.after.in_words}")
        except KeyboardInterrupt:
            status = 130
    if found:
        _tell(arguments, kinds, found)
    return status


def _checked(arguments: argparse.Namespace) -> list[str]:
    from bender_loop.errors import InputError
    from bender_studies.benchmarks.discrepancy import KINDS as KNOWN

    kinds = list(arguments.kinds or KINDS)
    for kind in kinds:
        if kind not in KNOWN:
            raise InputError(f"--kinds: found {kind!r}, expected one of {', '.join(KNOWN)}")
    for name in ("seeds", "nothing_seeds", "each", "jobs"):
        value = getattr(arguments, name)
        if value is not None and value < 1:
            raise InputError(f"--{name.replace('_', '-')}: found {value}, expected at least 1")
    if arguments.first_seed < 0:
        raise InputError(f"--first-seed: found {arguments.first_seed}, expected at least 0")
    if not 0.0 < arguments.part < 1.0:
        raise InputError(f"--part: found {arguments.part:g}, expected more than 0 and less than 1")
    return kinds


def _tell(arguments: argparse.Namespace, kinds: list[str], found: "list[Compared]") -> None:
    from dataclasses import asdict

    from bender_loop.shell.files import write_result
    from bender_loop.shell.progress import print_table
    from bender_studies.hidden_effects.constants import totals

    print_table("Verdicts that change", ("constant", "value", "cases", "other verdict", "part"), totals(found))
    other = [
        [x.changed.name, f"{x.changed.value:g}", " + ".join(x.truth) or "nothing", x.before.in_words, x.after.in_words]
        for x in found
        if x.differs
    ]
    if other:
        print_table("Other verdicts", ("constant", "value", "hidden", "as it is", "changed"), other)
    settings = {"kinds": kinds, "first_seed": arguments.first_seed, "part": arguments.part}
    write_result(arguments.out / "constants.json", {**settings, "verdicts": [asdict(x) for x in found]})
    sys.stdout.write(f"written: {arguments.out / 'constants.json'}\n")
