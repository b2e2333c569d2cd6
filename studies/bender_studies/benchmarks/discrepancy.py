"""`bender benchmark discrepancy`: benches with something hidden are diagnosed, and the answers held to the truth."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    from bender_studies.hidden_effects.judging import Judged
    from bender_studies.hidden_effects.session import Nominal

    Table = tuple[str, Sequence[str], Sequence[Sequence[Any]]]

HELP = "how often `bender diagnose` finds what an independent generator has hidden"
USUAL = ("singles", "pairs", "nothing", "calibrations", "outside", "weak")
OF_FMU = ("singles", "nothing")
KINDS = (
    *USUAL,
    "triples",
    "quadruples",
    "quintuples",
    "faint",
    "moved",
    "begun",
    "approximate",
    "lagging",
    "loops",
    "starts",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare which cases are judged, and where the results go."""
    parser.add_argument("--seeds", type=int, default=3, metavar="N", help="cases of each kind (default: 3)")
    parser.add_argument(
        "--nothing-seeds", type=int, default=200, metavar="N", help="cases in which nothing is hidden (default: 200)"
    )
    parser.add_argument("--first-seed", type=int, default=1, metavar="N", help="seed of the first case (default: 1)")
    parser.add_argument("--kinds", nargs="+", metavar="KIND", help=f"of {', '.join(KINDS)}; default: the first six")
    parser.add_argument("--effects", nargs="+", metavar="ID", help="only cases in which one of these effects is hidden")
    parser.add_argument(
        "--frames",
        choices=("clean", "spoiled", "both"),
        default="clean",
        help="clean (default), or spoiled: 1 %% of the readings are outliers, 2 %% are lost",
    )
    parser.add_argument(
        "--as-fmu",
        choices=("linear", "paper"),
        help="singles and nothing with the nominal model only as an FMU: a gain and a mode, or the paper's equation",
    )
    parser.add_argument(
        "--suspects", type=int, metavar="N",
        help="instead: N FMUs with a wrong parameter, a missing effect, or both",
    )  # fmt: skip
    parser.add_argument(
        "--intervals", type=int, metavar="N",
        help="N numbers with one true value, held to their 95 %% intervals, instead of the kinds; every second camera "
        "is exposed for some time",
    )  # fmt: skip
    parser.add_argument(
        "--witnesses", type=int, metavar="N",
        help="instead: N benches where only a read-back voltage or a temperature distinguishes the effects",
    )  # fmt: skip
    parser.add_argument("--jobs", type=int, metavar="N", help="parallel processes (default: one per processor)")


def run(arguments: argparse.Namespace) -> int:
    """Judge, print the tables, write discrepancy.json; an interrupt keeps what was judged."""
    import tempfile

    from bender_loop.shell.files import prepare_directory
    from bender_studies.hidden_effects.session import judge_cases
    from bender_studies.runner import collected

    kinds = _checked(arguments)
    prepare_directory(arguments.out)
    for name, judge in (("suspects", _suspects), ("intervals", _intervals), ("witnesses", _witnesses)):
        if getattr(arguments, name):
            return judge(arguments)
    with tempfile.TemporaryDirectory() as folder:
        nominal = _nominal(arguments, Path(folder)) if arguments.as_fmu else None
        judged = judge_cases(_cases(arguments, kinds), Path(folder), arguments.jobs, nominal=nominal)
        found, status = collected(
            judged, "discrepancy benchmark, cases", lambda x: f"{' + '.join(x.truth) or x.kind}: {x.said}"
        )
    if found:
        _tell(arguments, kinds, found)
    return status


def _suspects(arguments: argparse.Namespace) -> int:
    """Judge parameters against effects, print a row for each wrong answer, write suspects.json."""
    from bender_studies.hidden_effects.suspected import judged_suspects, totals

    def tables(found: list[Any]) -> "list[Table]":
        wrong = [[str(x.answer.number), x.truth, x.said] for x in found if not x.is_right]
        return [
            ("Parameter against effect", ("hidden", "cases", "right", "ambiguous", "false names"), totals(found)),
            ("Not right", ("case", "hidden", "answer"), wrong),
        ]

    said = "parameter against effect, cases"
    found, status = _collected(
        arguments, range(arguments.suspects), judged_suspects, said, lambda x: f"{x.truth}: {x.said}"
    )
    return _reported(arguments, "suspects.json", found, status, tables)


def _intervals(arguments: argparse.Namespace) -> int:
    """Hold numbers to their stated intervals, print the shares and a row for each miss, write intervals.json."""
    from bender_studies.hidden_effects.intervals import intervals, misses, numbers_of, totals

    numbers = numbers_of(arguments.intervals, arguments.effects or ())
    shares = "95 % intervals that hold the truth", ("benches", "intervals", "cover", "share", "95 %"), totals
    missed = "Missed, or not told", ("truth", "found", "deviation", "off by", "verdict"), misses
    tables, said = _shares_and_misses(shares, missed), "stated intervals, benches"
    found, status = _collected(arguments, numbers, intervals, said, lambda x: x.in_words)
    return _reported(arguments, "intervals.json", found, status, tables)


def _shares_and_misses(*told: tuple[str, tuple[str, ...], Any]) -> "Callable[[list[Any]], list[Table]]":
    """Return what makes two tables of judged numbers: shares by what is hidden, and a row for each that missed."""
    firsts = ("hidden",), ("bench", "hidden")
    return lambda found: [
        (title, first + columns, rows(found)) for first, (title, columns, rows) in zip(firsts, told, strict=True)
    ]


def _witnesses(arguments: argparse.Namespace) -> int:
    """Judge confused benches with their instruments, print a row for each wrong answer, write witnesses.json."""
    from bender_studies.hidden_effects.witnessed import totals, witnessed

    def tables(found: list[Any]) -> "list[Table]":
        drawn = f"{len(found)} of {found[-1].drawn} benches drawn were confused without the other channels"
        columns = ("hidden", "benches", "right", "95 % interval", "false names")
        wrong = [[str(x.number), x.effect, x.without.in_words, x.answer.in_words] for x in found if not x.is_right]
        return [
            (f"{drawn}, diagnosed with them", columns, totals(found)),
            ("Not right", ("bench", "hidden", "without", "with"), wrong),
        ]

    said = "benches with witnesses"
    found, status = _collected(
        arguments, range(arguments.witnesses), witnessed, said, lambda x: f"{x.effect}: {x.answer.in_words}"
    )
    return _reported(arguments, "witnesses.json", found, status, tables)


def _collected(
    arguments: argparse.Namespace,
    numbers: Sequence[int],
    judged: Any,
    title: str,
    in_words: "Callable[[Any], str]",
) -> tuple[list[Any], int]:
    """Return the cases that were judged, and the exit status; an interrupt keeps those that are complete."""
    import tempfile

    from bender_studies.runner import collected

    with tempfile.TemporaryDirectory() as folder:
        return collected(judged(numbers, arguments.first_seed, Path(folder), arguments.jobs), title, in_words)


def _reported(
    arguments: argparse.Namespace,
    name: str,
    found: list[Any],
    status: int,
    tables: "Callable[[list[Any]], list[Table]]",
) -> int:
    """Print the tables that have rows and write the cases; nothing where none was judged. Returns the exit status."""
    from dataclasses import asdict

    from bender_loop.shell.progress import print_table
    from bender_studies.runner import write_facts

    if not found:
        return status
    for title, columns, rows in tables(found):
        if rows:
            print_table(title, columns, rows)
    write_facts(arguments.out / name, {"seed": arguments.first_seed, "cases": [asdict(x) for x in found]})
    return status


def _checked(arguments: argparse.Namespace) -> list[str]:
    from bender_loop.errors import InputError
    from bender_proving import INSIDE, OUTSIDE
    from bender_studies.hidden_effects.intervals import KNOWN
    from bender_studies.runner import check_known, check_least

    check_known("--kinds", arguments.kinds or (), KINDS)
    check_known("--effects", arguments.effects or (), KNOWN if arguments.intervals else INSIDE | OUTSIDE)
    for name in ("suspects", "witnesses"):
        if arguments.effects and getattr(arguments, name):
            raise InputError(f"--effects: found --{name}, expected --kinds or --intervals with it")
    check_least(arguments, 1, "seeds", "nothing_seeds", "jobs", "suspects", "intervals", "witnesses")
    check_least(arguments, 0, "first_seed")
    if arguments.as_fmu and set(arguments.kinds or ()) - set(OF_FMU):
        raise InputError(f"--as-fmu: found the kinds {', '.join(arguments.kinds)}, expected {' or '.join(OF_FMU)}")
    return list(dict.fromkeys(arguments.kinds or (OF_FMU[:1] if arguments.as_fmu else USUAL)))


def _nominal(arguments: argparse.Namespace, folder: Path) -> "Nominal":
    from bender_native.ready import ready_plant_fmu
    from bender_plant.blocks import BLOCKS
    from bender_plant.model import BlockSettings, Model, load_model
    from bender_proving.cases.nominal import FREQUENCY_HZ, GAIN_UM_PER_V, ZETA
    from bender_studies.hidden_effects.session import Nominal

    model = load_model("paper")
    is_linear = arguments.as_fmu == "linear"
    if is_linear:
        mode = {"first_frequency_Hz": FREQUENCY_HZ, "damping_ratio": ZETA}
        chain = (("linear_transduction", {"sensitivity_um_per_V": GAIN_UM_PER_V}), ("bending_modes", mode))
        blocks = tuple(BlockSettings(x, BLOCKS[x].parameters(**values)) for x, values in chain)
        model = Model("linear", None, blocks)
    path = folder / "nominal.fmu"
    path.write_bytes(ready_plant_fmu(model).read_bytes())
    return Nominal(path, is_linear)


def _cases(arguments: argparse.Namespace, kinds: Sequence[str]) -> Any:
    """Yield a case of every kind in turn, so that an interrupted run holds some of each."""
    from itertools import chain, zip_longest

    from bender_proving import cases

    wanted = set(arguments.effects or ())
    prefixes = {"clean": ("",), "spoiled": ("spoiled ",), "both": ("", "spoiled ")}

    def drawn(kind: str) -> Any:
        count = arguments.nothing_seeds if kind in ("nothing", "starts") else arguments.seeds
        return cases(kind, range(arguments.first_seed, arguments.first_seed + count))

    for prefix in prefixes[arguments.frames]:
        in_turn = chain.from_iterable(zip_longest(*(drawn(prefix + kind) for kind in kinds)))
        yield from (x for x in in_turn if x is not None and (not wanted or wanted & set(x.effect_ids)))


def _tell(arguments: argparse.Namespace, kinds: Sequence[str], found: "Sequence[Judged]") -> None:
    from bender_loop.shell.files import write_atomically
    from bender_loop.shell.progress import print_table
    from bender_studies.hidden_effects import outputs
    from bender_studies.hidden_effects.figures import figures, figures_of_fmu

    told = figures_of_fmu if arguments.as_fmu else figures

    settings = {
        "seeds": arguments.seeds,
        "nothing_seeds": arguments.nothing_seeds,
        "first_seed": arguments.first_seed,
        "kinds": list(kinds),
        "effects": arguments.effects,
        "frames": arguments.frames,
        "as_fmu": arguments.as_fmu,
    }
    clean, spoiled = outputs.clean(found), outputs.spoiled(found)
    for heading, some in (("Clean records", clean), ("1 % outlying and 2 % lost frames", spoiled)):
        if some:
            print_table(heading, outputs.COLUMNS, [outputs.cells(x) for x in told(some)])
            sys.stdout.write("\n")
    print_table("Taken for something else", ("hidden", "answer", "cases"), outputs.confusion_cells(found))
    sys.stdout.writelines(f"{sentence}\n" for sentence in outputs.sentences(found))
    write_atomically(arguments.out / "discrepancy.json", outputs.to_json(settings, found))
    sys.stdout.write(f"written: {arguments.out / 'discrepancy.json'}\n")
