"""`bender benchmark control`: hidden benches, diagnosed, then run with and without the corrected model in the loop."""

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bender_proving import Case
    from bender_studies.control.trial import Tried

HELP = "measure what a controller that uses the diagnosed model is worth on hidden benches"
EFFECTS = (
    "rate_independent_hysteresis", "creep", "transport_delay", "source_resistance", "slew_limit", "saturation",
    "backlash", "thermal_drift",
)  # fmt: skip
"""Hidden by themselves, and in pairs."""
_STRIDE = 7
"""The pairs are taken in strides of so many, so that any few of them have most effects."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare which benches are tried, and where the results go."""
    parser.add_argument("--benches", type=int, default=40, metavar="N", help="number of hidden benches (default: 40)")
    parser.add_argument(
        "--first-seed", type=int, default=61001, metavar="N", help="seed of the first bench (default: 61001)"
    )
    parser.add_argument("--effects", nargs="+", metavar="ID", help=f"hidden ones (default: {', '.join(EFFECTS)})")
    parser.add_argument(
        "--evaluations", type=int, default=91, metavar="N", help="evaluations in each tuning (default: 91)"
    )
    parser.add_argument("--wrong-name", action="store_true", help="give every model an effect that is not there")
    parser.add_argument("--spread", type=int, default=0, metavar="N", help="runs of each on other devices (default: 0)")
    parser.add_argument(
        "--learn", type=int, default=0, metavar="N", help="instead: a scan on N benches with hysteresis and creep"
    )
    parser.add_argument("--jobs", type=int, metavar="N", help="parallel processes (default: one per processor)")


def run(arguments: argparse.Namespace) -> int:
    """Try the benches, print the table, write control.json; goes on from an earlier run that was asked the same.

    Records and diagnoses stay in the folder: a run that is asked something else of the same benches takes them from
    there.
    """
    import json
    from itertools import islice

    from bender_loop.shell.files import finite, prepare_directory, write_atomically
    from bender_loop.shell.progress import print_table
    from bender_loop.shell.run import version
    from bender_studies.control import figures
    from bender_studies.control.trial import Trial, try_bench
    from bender_studies.runner import collected, in_processes

    if arguments.learn:
        return _learn(arguments)
    benches = list(islice(hidden_benches(arguments.effects or EFFECTS, arguments.first_seed), arguments.benches))
    trial = Trial(arguments.evaluations, EFFECTS if arguments.wrong_name else (), arguments.spread)
    prepare_directory(arguments.out)
    path, asked = arguments.out / "control.json", _asked(arguments)
    kept = {x.id: x for x in _kept(path, asked)}

    def keep(found: "list[Tried]") -> None:
        content = {"asked": asked, "benches": [x.to_dict() for x in (kept | {x.id: x for x in found}).values()]}
        write_atomically(path, json.dumps(finite(content), indent=1, allow_nan=False) + "\n")

    place = arguments.out / f"benches of {version()}"
    tasks = [(x, place / x.id, trial) for x in benches if x.id not in kept]
    tried = in_processes(try_bench, tasks, arguments.jobs, in_order=False)
    new, status = collected(tried, "benches in a loop", lambda x: " + ".join(x.truth), len(tasks), keep)
    known = kept | {x.id: x for x in new}
    found = [known[x.id] for x in benches if x.id in known]
    if found:
        print_table("Hidden benches in a loop", figures.COLUMNS, figures.rows(found), of_cases=True)
        print_table("What was asked, over all of them", figures.CLAIMS, figures.claims(found))
        sys.stdout.writelines(f"{x.id}: {x.error}\n" for x in found if x.error)
        sys.stdout.write(f"written: {path}\n")
    return status


def _asked(arguments: argparse.Namespace) -> dict[str, Any]:
    """What has to be the same where a run goes on from an earlier one."""
    from bender_loop.shell.run import version

    names = "effects", "first_seed", "evaluations", "wrong_name", "spread"
    return {"version": version()} | {name: getattr(arguments, name) for name in names}


def _kept(path: Path, asked: dict[str, Any]) -> "list[Tried]":
    """The benches of an earlier run that was asked the same, but for those that failed; a refusal is an answer."""
    import json

    from bender_studies.control.trial import FAILED, Tried

    try:
        earlier = json.loads(path.read_text(encoding="utf-8"))
        if earlier["asked"] != asked:
            return []
        return [found for x in earlier["benches"] if (found := Tried.from_dict(x)).verdict != FAILED]
    except (OSError, ValueError, LookupError, TypeError):
        return []


def _learn(arguments: argparse.Namespace) -> int:
    """Learn a scan of 1 Hz over hysteresis, creep and both, the nominal model followed."""
    from itertools import islice

    from bender_loop.shell.progress import print_table
    from bender_studies.control import figures, learned
    from bender_studies.runner import collected, silence

    silence()
    benches = islice(learned.cases(arguments.first_seed), arguments.learn)
    learnt = learned.learn_on(benches, learned.PASSES, arguments.evaluations)
    found, status = collected(learnt, "benches that learn", lambda x: " + ".join(x.truth), 2 * arguments.learn)
    print_table("A scan of 1 Hz, learned", learned.COLUMNS, learned.rows(found), of_cases=True)
    print_table("What was asked of learning", figures.CLAIMS, [list(x) for x in learned.claims(found)])
    return status


def hidden_benches(wanted: Sequence[str], first_seed: int) -> "Iterator[Case]":
    """Every effect by itself on the camera, a pair of them of two stages behind each, seed after seed."""
    from itertools import combinations, count

    from bender_effects.catalogue import EFFECTS as CATALOGUE
    from bender_loop.errors import InputError
    from bender_proving import INSIDE, DrawError, make_case

    if unknown := set(wanted) - set(INSIDE):
        raise InputError(f"--effects: found {sorted(unknown)[0]!r}, expected some of {', '.join(INSIDE)}")
    stages = {name: CATALOGUE[name].stage for name in wanted}
    pairs = [pair for pair in combinations(wanted, 2) if stages[pair[0]] != stages[pair[1]]]
    for turn in count():
        for place, name in enumerate(wanted):
            stride = _STRIDE * (turn * len(wanted) + place)
            for hidden in ((name,), *([pairs[stride % len(pairs)]] if pairs else [])):
                with suppress(DrawError):
                    yield make_case("single" if len(hidden) == 1 else "pair", hidden, first_seed + turn, "camera")
