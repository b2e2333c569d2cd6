"""`bender benchmark diagnose`: how long a diagnosis takes, and how time and memory grow with the record."""

import argparse
import itertools
import math
import statistics
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bender_studies.benchmarks.diagnose_runs import Run

HELP = "time of `bender diagnose`, cold and warm; growth of time and memory with the record"

COLD_S, WARM_S, VIBROMETER_S, MILLION_S = 15.0, 4.0, 60.0, 60.0
SEVERAL_S = {"pair": 15.0, "triple": 40.0, "five": 120.0}
"""Of a camera record that hides several effects."""
# exponent of the time between neighbouring lengths: 1 is linear, and the clock of a shared machine is not exact
LINEAR = 1.05
SHORTEST, LONGEST = 1_000, 1_000_000
PARTS = ("camera", "several", "vibrometer", "growth")
MILLION = 1_000_000


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure beside its target, in one unit; `found` is held to be at most `target`."""

    what: str
    found: float
    target: float
    unit: str

    @property
    def met(self) -> bool:
        """Whether the target is met."""
        return self.found <= self.target


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what is measured, and where the results go."""
    parser.add_argument(
        "--parts",
        nargs="+",
        metavar="PART",
        help=f"default: all of {', '.join(PARTS)}",
    )
    parser.add_argument(
        "--longest", type=int, default=LONGEST, metavar="ROWS", help=f"rows of the longest record (default: {LONGEST})"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the first bench (default: 1)")


def run(arguments: argparse.Namespace) -> int:
    """Print the tables with their targets, write diagnose.json; an interrupt keeps what was measured."""
    from tempfile import TemporaryDirectory

    from bender_loop.shell.files import prepare_directory
    from bender_loop.shell.progress import Progress

    parts = _checked(arguments)
    prepare_directory(arguments.out)
    runs: dict[str, list[Run]] = {}
    status = 0
    with TemporaryDirectory() as folder, Progress("diagnose benchmark, runs") as bar:
        try:
            for name, found in _measured(parts, Path(folder), arguments.longest, arguments.seed):
                runs.setdefault(name, []).append(found)
                bar.update(sum(map(len, runs.values())), None, f"{found.record}: {found.seconds:.1f} s")
        except KeyboardInterrupt:
            status = 130
    if runs:
        _tell(arguments.out, runs)
    return status


def _checked(arguments: argparse.Namespace) -> Sequence[str]:
    from bender_loop.errors import InputError

    for name in arguments.parts or ():
        if name not in PARTS:
            raise InputError(f"--parts: found {name!r}, expected one of {', '.join(PARTS)}")
    if arguments.longest < SHORTEST:
        raise InputError(f"--longest: found {arguments.longest}, expected at least {SHORTEST}")
    if arguments.seed < 0:
        raise InputError(f"--seed: found {arguments.seed}, expected at least 0")
    return arguments.parts or PARTS


def _measured(parts: Sequence[str], folder: Path, longest: int, seed: int) -> Iterator[tuple[str, "Run"]]:
    """Yield the name of a part and a run of it."""
    from bender_studies.benchmarks.diagnose_runs import (
        GROWING,
        SEVERAL,
        VIBROMETER,
        VIBROMETER_ROWS,
        timed,
        write_beginning,
        write_camera_record,
        write_long_record,
    )

    cache = folder / "cache"
    if "camera" in parts:
        yield from _camera(folder, cache, seed)
    if "several" in parts:
        records = {
            name: write_camera_record(folder / f"{name}.csv", kind, hidden, seed)
            for name, (kind, hidden) in SEVERAL.items()
        }
        # nothing that is measured is compiled in it
        timed(next(iter(records.values())), cache)
        for name, record in records.items():
            yield name, timed(record, cache)
    if "vibrometer" in parts:
        record = write_long_record(folder / "vibrometer.csv", *VIBROMETER, seed, "vibrometer", VIBROMETER_ROWS)
        timed(record, cache)
        yield "vibrometer", timed(record, cache)
    if "growth" in parts:
        whole = write_long_record(folder / "whole.csv", *GROWING, seed, "camera", longest)
        records = [write_beginning(folder / f"rows-{rows}.csv", whole, rows) for rows in _lengths(longest)]
        timed(records[0], cache)
        for record in records:
            yield "growth", timed(record, cache)


def _camera(folder: Path, cache: Path, seed: int) -> Iterator[tuple[str, "Run"]]:
    """Yield the cold run, nothing being compiled yet, and then a warm one of every record."""
    from bender_studies.benchmarks.diagnose_runs import CAMERA, timed, write_camera_record

    for kind, hidden in CAMERA:
        record = write_camera_record(folder / f"{'-'.join(hidden) or kind}.csv", kind, hidden, seed)
        # the first run of a record compiles what the ones before had no use for
        first = timed(record, cache)
        if (kind, hidden) == CAMERA[0]:
            yield "cold", first
        yield "warm", timed(record, cache)


def _lengths(longest: int) -> list[int]:
    """Return the lengths of the growing record: tenfold each, up to the longest."""
    found = [SHORTEST]
    while found[-1] < longest:
        found.append(min(10 * found[-1], longest))
    return found


def figures(runs: "dict[str, list[Run]]") -> list[Figure]:
    """Return the figures that have a target."""
    found = []
    if "cold" in runs:
        found.append(Figure("camera record of 170 s, nothing compiled yet", runs["cold"][0].seconds, COLD_S, "s"))
    if "warm" in runs:
        middle = statistics.median(x.seconds for x in runs["warm"])
        found.append(Figure(f"the same, compiled, median of {len(runs['warm'])} benches", middle, WARM_S, "s"))
    for name, bound_s in SEVERAL_S.items():
        found += [Figure(f"camera record, {name} of effects", x.seconds, bound_s, "s") for x in runs.get(name, [])]
    if "vibrometer" in runs:
        record = runs["vibrometer"][0]
        found.append(Figure(f"vibrometer record of {record.rows} rows", record.seconds, VIBROMETER_S, "s"))
    growing = runs.get("growth", [])
    found += [Figure(f"record of {x.rows} rows", x.seconds, MILLION_S, "s") for x in growing if x.rows == MILLION]
    for before, after in itertools.pairwise(growing):
        found.append(
            Figure(f"growth from {before.rows} to {after.rows} rows", exponent(before, after), LINEAR, "power")
        )
    return found


def exponent(before: "Run", after: "Run") -> float:
    """Return the power of the number of rows with which the time grows from one run to the next."""
    return math.log(after.seconds / before.seconds) / math.log(after.rows / before.rows)


def _tell(out: Path, runs: "dict[str, list[Run]]") -> None:
    from bender_loop.shell.files import write_result
    from bender_loop.shell.progress import Cell, print_table

    table = figures(runs)
    rows: list[list[Cell]] = [[x.what, x.unit, x.found, x.target, "yes" if x.met else "NO"] for x in table]
    print_table("What a diagnosis costs", ("measured", "unit", "found", "at most", "met"), rows)
    sys.stdout.write("\n")
    single: list[list[Cell]] = [
        [part, x.record, x.rows, x.seconds, x.processor_s, x.peak_MB, f"{x.verdict}: {', '.join(x.effects) or '-'}"]
        for part, found in runs.items()
        for x in found
    ]
    print_table("Every run", ("part", "record", "rows", "s", "processor s", "peak MB", "answer"), single)
    facts = {
        "figures": [asdict(x) | {"met": x.met} for x in table],
        "runs": {part: [x.to_dict() for x in found] for part, found in runs.items()},
    }
    write_result(out / "diagnose.json", facts)
    sys.stdout.write(f"written: {out / 'diagnose.json'}\n")
