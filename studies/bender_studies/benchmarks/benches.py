"""`bender benchmark benches`: five kinds of benches from their first check to the diagnosis, by every command."""

import argparse
import sys
from dataclasses import asdict

HELP = "five emulated benches of different kinds: check, step, staircase, investigation and diagnosis of each"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare which benches, and for how long they are investigated."""
    parser.add_argument("--only", nargs="+", metavar="WORD", help="benches whose names have one of these words")
    parser.add_argument(
        "--budget-s", type=float, default=240.0, metavar="S", help="bench time of each investigation (default: 240)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run every command on every bench, print the table, write benches.json; 1 where one is not as it should be."""
    import tomli_w

    from bender_export.build import ensure_plant_fmu
    from bender_loop.errors import InputError
    from bender_loop.shell.files import finite, prepare_directory, result_text, unused, write_atomically
    from bender_loop.shell.progress import Progress, print_table
    from bender_studies.bench_trials.end_to_end import HIDDEN, KINDS, EndToEnd, hidden_model, run_end_to_end

    kinds = [kind for kind in KINDS if not arguments.only or any(word in kind.name for word in arguments.only)]
    if not kinds:
        raise InputError(f"--only: expected words of {'; '.join(kind.name for kind in KINDS)}")
    out = prepare_directory(arguments.out)
    model = out / "hidden.toml"
    write_atomically(model, tomli_w.dumps(hidden_model().to_table()))
    fmu = ensure_plant_fmu(str(model))
    found: list[EndToEnd] = []
    with Progress("benches from end to end") as progress:
        for number, kind in enumerate(kinds, 1):
            folder = unused(out / kind.name.replace(",", "").replace(" ", "-"))
            found.append(run_end_to_end(kind, fmu, folder.absolute(), arguments.budget_s))
            progress.update(number, len(kinds), kind.name)
            write_atomically(out / "benches.json", result_text(finite({"benches": [asdict(x) for x in found]})))
    rows = [
        [
            x.name,
            " ".join(map(str, x.statuses.values())),
            _words(x.investigated),
            _words(x.diagnosed),
            "; ".join(x.broken) or "-",
        ]
        for x in found
    ]
    print_table(f"benches that hide {' and '.join(HIDDEN)}", ["bench", "statuses", *_COLUMNS], rows)
    broken = sum(bool(x.broken) for x in found)
    sys.stdout.write(
        f"{len(found)} benches, {len(found) - broken} as they should be\nwritten: {out / 'benches.json'}\n"
    )
    return int(broken > 0)


_COLUMNS = ("investigate", "diagnose", "not as it should be")


def _words(answer: tuple[str, dict[str, str]]) -> str:
    verdict, effects = answer
    return f"{verdict or 'none'}: {', '.join(f'{name} ({grade})' for name, grade in effects.items()) or '-'}"
