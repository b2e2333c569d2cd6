"""`bender benchmark probabilities`: how well the probabilities of diagnoses are kept, and the weights they teach."""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bender_loop.shell.progress import Cell
    from bender_studies.hidden_effects.probabilities import JudgedEffect

HELP = (
    "how well the probabilities of diagnoses are kept, from what `bender benchmark fuzz` and `bender benchmark "
    "discrepancy` have written; the weights that half of the cases teach, held to the others"
)
DEVICES, BENCHES = "devices.json", "discrepancy.json"
SOURCES = {DEVICES: "drawn devices", BENCHES: "hidden benches"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare where the results lie."""
    parser.add_argument(
        "results", nargs="*", type=Path, metavar="DIR", default=[Path("results")],
        help=f"folders with {DEVICES} or {BENCHES} (default: results)",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Print how well they are kept, by the weights of the product and by those of every second case; write JSON.

    Raises:
        InputError: no result is found, or one is none.
    """
    from bender_inference.search.judgement.probability import WEIGHTS
    from bender_loop.errors import InputError
    from bender_loop.shell.files import prepare_directory, write_result
    from bender_loop.shell.progress import print_table
    from bender_studies.hidden_effects.probabilities import COLUMNS, by, calibration_error, reliability, weights

    cases = _cases(arguments.results)
    halves = [[x for _, number, told in cases if number % 2 == odd for x in told] for odd in (0, 1)]
    if not all(halves):
        raise InputError(f"found effects in {len(cases)} cases, expected some in every second case and in the others")
    learned = weights(halves[0])
    errors: list[list[Cell]] = []
    for source in (*dict.fromkeys(x for x, _, _ in cases), "all"):
        own = [(number, told) for x, number, told in cases if source in (x, "all")]
        everything, others = ([x for n, told in own if n % 2 >= odd for x in told] for odd in (0, 1))
        kept, held = by(everything, WEIGHTS), by(others, learned)
        error = calibration_error(held) if held else None
        errors.append([source, len(own), len(kept), calibration_error(kept), len(held), error])
        if source == "all":
            print_table("All, by the weights of the product", COLUMNS, reliability(kept))
            print_table("The other half, by the weights of every second case", COLUMNS, reliability(held))
    heads = ("cases of", "cases", "effects", "error", "effects of the other half", "error by weights of every second")
    print_table("Expected calibration error", heads, errors)
    taught = weights([x for _, _, told in cases for x in told])
    rows = [
        [x, *map(float, y)] for x, y in (("product", WEIGHTS), ("every second case", learned), ("all cases", taught))
    ]
    print_table("Weights", ("of", "one", "passed", "deviations", "log_ratio", "closed"), rows)
    out = prepare_directory(arguments.out) / "probabilities.json"
    write_result(out, {"errors": [dict(zip(heads, x, strict=True)) for x in errors], "weights_of_all": list(taught)})
    sys.stdout.write(f"written: {out}\n")
    return 0


def _cases(places: list[Path]) -> "list[tuple[str, int, list[JudgedEffect]]]":
    """Return the source, the number and the effects of each case that told any."""
    from bender_loop.errors import InputError

    found = []
    for place in places:
        files = [x for name in SOURCES for x in (sorted(place.rglob(name)) if place.is_dir() else [])]
        if not files:
            raise InputError(f"{place}: found no {DEVICES} and no {BENCHES}, expected a folder of results with one")
        for file in files:
            try:
                content = json.loads(file.read_text(encoding="utf-8"))
                told = list(_of_devices(content) if file.name == DEVICES else _of_benches(content))
            except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
                raise InputError(f"{file}: found no result that has what its names follow from ({error!r})") from None
            found += [(SOURCES[file.name], k, x) for k, x in enumerate(told) if x]
    return found


def _of_devices(content: Mapping[str, Any]) -> "Iterator[list[JudgedEffect]]":
    from bender_inference.search.judgement.probability import Case
    from bender_studies.hidden_effects.probabilities import JudgedEffect

    for device in content["tried"]:
        told = (x for x in device["told"] if x["weighed"])
        yield [JudgedEffect(Case(**x["weighed"]).parts, x["is_there"]) for x in told]


def _of_benches(content: Mapping[str, Any]) -> "Iterator[list[JudgedEffect]]":
    from bender_studies.hidden_effects.probabilities import JudgedEffect

    for bench in content["cases"]:
        yield [JudgedEffect(tuple(x["case"]), name in bench["hidden"]) for name, x in bench["told"].items()]
