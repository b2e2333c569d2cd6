"""`bender benchmark investigate`: hidden benches are investigated in virtual time, the answers held to the truth."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

    from bender_proving import Case
    from bender_studies.investigations.trial import InvestigationTrial

HELP = "how often `bender investigate` finds what a bench hides, in how much bench time, and better gains for it"
FAR_OFF = 1_000_000
"""A seed that shows nothing is replaced by one that lies so far off."""
KINDS = ("singles", "pairs", "nothing", "weak")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare which benches are investigated, and where the results go."""
    parser.add_argument("--kinds", nargs="+", metavar="KIND", help=f"default: all of {', '.join(KINDS)}")
    parser.add_argument("--effects", nargs="+", metavar="ID", help="only benches that hide one of these")
    parser.add_argument("--seeds", type=int, default=1, metavar="N", help="benches of each kind (default: 1)")
    parser.add_argument(
        "--nothing-seeds", type=int, default=5, metavar="N", help="benches with nothing hidden (default: 5)"
    )
    parser.add_argument(
        "--first-seed", type=int, default=7001, metavar="N", help="seed of the first bench (default: 7001)"
    )
    parser.add_argument(
        "--budget-s", type=float, default=600.0, metavar="S", help="bench time of each investigation (default: 600)"
    )
    parser.add_argument("--jobs", type=int, metavar="N", help="parallel processes (default: one per processor)")


def run(arguments: argparse.Namespace) -> int:
    """Investigate, print the tables, write investigate.json; an interrupt keeps what is done."""
    import json
    import tempfile

    from bender_loop.shell.files import finite, prepare_directory, write_atomically
    from bender_loop.shell.progress import print_table
    from bender_studies.investigations import figures
    from bender_studies.investigations.trial import run_trial
    from bender_studies.runner import collected, in_processes

    cases = list(_cases(arguments))
    prepare_directory(arguments.out)
    path = arguments.out / "investigate.json"

    def keep(found: "list[InvestigationTrial]") -> None:
        text = json.dumps(finite([x.to_dict() for x in found]), indent=1, allow_nan=False)
        write_atomically(path, text + "\n")

    with tempfile.TemporaryDirectory() as place:
        old = _old_gains(Path(place))
        tasks = [(x, Path(place) / x.id, arguments.budget_s, old) for x in cases]
        tried = in_processes(run_trial, tasks, arguments.jobs, in_order=False)
        found, status = collected(
            tried,
            "investigations",
            lambda x: f"{' + '.join(x.truth) or x.kind}: {x.verdict}",
            len(cases),
            keep,
        )
    if found:
        print_table("Benches in virtual time", figures.COLUMNS, figures.rows(found))
        sys.stdout.writelines(f"{sentence}\n" for sentence in figures.sentences(found))
        sys.stdout.write(f"written: {path}\n")
    return status


def _cases(arguments: argparse.Namespace) -> "Iterator[Case]":
    """Return every effect once on the first sensor that excites it, pairs, benches with nothing hidden, weak starts."""
    from bender_proving import INSIDE, cases
    from bender_studies.runner import check_known

    wanted, kinds = set(arguments.effects or ()), arguments.kinds or KINDS
    check_known("--effects", sorted(wanted), INSIDE)
    check_known("--kinds", kinds, KINDS)
    for kind in kinds:
        count = arguments.nothing_seeds if kind == "nothing" else arguments.seeds
        seen: set[Any] = set()
        for case in cases(kind, range(arguments.first_seed, arguments.first_seed + count)):
            key = (case.effect_ids, case.seed % FAR_OFF)
            if (wanted and not wanted & set(case.effect_ids)) or (kind == "singles" and key in seen):
                continue
            seen.add(key)
            yield case


def _old_gains(folder: Path) -> Path:
    """Tune on the nominal model, as the bench that hides nothing would have been."""
    from bender_investigate.proof import Task
    from bender_investigate.retuning import GAINS, tune_settings, tuned
    from bender_native.ready import ready_plant_fmu
    from bender_studies.investigations.trial import MODEL
    from bender_studies.investigations.virtual_bench import LOOP_GUARD, LOOP_HZ, allowed_by
    from bender_tuner.results.gains_file import write_gains

    task = Task.of_stroke(LOOP_GUARD.travel_um[1] / 2.0, 3.0)
    settings = tune_settings(allowed_by(LOOP_GUARD, LOOP_HZ), task, 0.06, 0.0, 151, 1)
    gains = tuned(ready_plant_fmu(MODEL), settings)
    write_gains(folder / GAINS, gains, settings.limits, settings.sampling.period_s)
    return folder / GAINS
