"""`bender model fit RECORD...`: a first model from records alone, as a model file and an FMU."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from bender_identify.first_model.structures import TEMPLATES
from bender_loop.records.arguments import add_record_arguments

if TYPE_CHECKING:
    from bender_identify.first_model.choice import FirstModel
    from bender_identify.records.experiment import Experiment
    from bender_loop.records.record import Record
    from bender_loop.tables.quantities import Quantities
    from bender_plant.model import Model


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the records, how they are read, the structure, and where the model goes."""
    parser.description = (
        "fit gain, lags, modes and delay, and write the simplest structure that simulates unseen blocks well"
    )
    parser.epilog = "example:\n  bender model fit record.csv --out mine.toml"
    parser.add_argument(
        "records", nargs="+", type=Path, metavar="RECORD", help="measured on one device: a table as `diagnose` takes it"
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="MODEL",
        help="model file (default: results/model-RECORD/model.toml, numbered where it exists)",
    )
    add_record_arguments(parser)
    parser.add_argument(
        "--input-hold",
        choices=("auto", "hold", "linear", "smooth"),
        default="auto",
        help="the input between two rows: held, straight, or smooth (band-limited); default: held, unless readings "
        "answer the input of their own row and another course fits far better",
    )
    parser.add_argument(
        "--template",
        choices=("auto", *TEMPLATES),
        default="auto",
        help="the structure; auto chooses by what is simulated of unseen blocks (default)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Fit, print, and write the model file, its FMU and the figures; all of them or none.

    Raises:
        InputError: a record or an option cannot be used, or the records excite nothing, or no structure follows them.
    """
    from bender_identify.first_model.direction import direction_sentence
    from bender_identify.first_model.learned import learn
    from bender_loop.records.arguments import record_of
    from bender_loop.records.common_units import in_units_of
    from bender_loop.shell.progress import Progress
    from bender_loop.shell.run import remark

    place = _place(arguments)
    names = [str(path) for path in arguments.records]
    records = in_units_of([record_of(arguments, path) for path in arguments.records], None, names)
    quantities = records[0].quantities
    only = None if arguments.template == "auto" else TEMPLATES[arguments.template]
    steps = 0
    with Progress("model fit") as bar:

        def tell(text: str) -> None:
            nonlocal steps
            steps += 1
            bar.update(steps, None, text)

        tell("reading what the input does between the rows")
        experiments = _experiments(arguments, records)
        named = arguments.records[0] if place.stem == "model" else place
        found, model = learn(experiments, named.stem, quantities, tell, only)
    written = _write(place, model, found, quantities)
    _print(found, quantities, written, is_free=only is None)
    if told := direction_sentence(records):
        remark(told)
    return 0


def _place(arguments: argparse.Namespace) -> Path:
    from bender_loop.errors import InputError
    from bender_loop.shell.files import unused

    out: Path = arguments.out or unused(Path("results") / f"model-{arguments.records[0].stem}") / "model.toml"
    place = out / "model.toml" if out.is_dir() else out
    if place.suffix != ".toml":
        raise InputError(f"--out: found {place}, expected the name of a model file that ends with .toml")
    return place


def _experiments(arguments: argparse.Namespace, records: "list[Record]") -> "list[Experiment]":
    from bender_identify.first_model.course import experiments_of

    names = [x.name for x in arguments.records]
    return experiments_of(records, names, arguments.input_hold)


def _write(place: Path, model: "Model", found: "FirstModel", quantities: "Quantities") -> list[Path]:
    from tempfile import TemporaryDirectory

    import tomli_w

    from bender_export.build import build_plant_fmu
    from bender_identify.first_model.report import facts
    from bender_loop.shell.files import keep_earlier, prepare_directory, result_text, write_atomically

    with TemporaryDirectory() as scratch:
        fmu = build_plant_fmu(model, Path(scratch) / "model.fmu").read_bytes()
    prepare_directory(place.parent)
    contents: dict[Path, str | bytes] = {
        place: tomli_w.dumps(model.to_table()),
        place.with_suffix(".fmu"): fmu,
        place.with_suffix(".json"): result_text(facts(found, quantities)),
    }
    *others, result = [x.name for x in contents]
    keep_earlier(place.parent, result, others)
    for path, content in contents.items():
        write_atomically(path, content)
    return list(contents)


def _print(found: "FirstModel", quantities: "Quantities", written: list[Path], *, is_free: bool) -> None:
    from bender_identify.first_model.report import (
        choice_sentence,
        columns,
        delay_sentence,
        doubt_sentence,
        quick_sentence,
        rms_sentence,
        sentences,
        table,
    )
    from bender_loop.shell.progress import print_table
    from bender_loop.shell.run import remark
    from bender_loop.tables.quantities import MICROMETRE, VOLT
    from bender_report.wording import unit_text

    print_table("structures tried (* is written)", columns(quantities), table(found))
    why = choice_sentence(found) if is_free else ""
    sys.stdout.write("".join(f"{x}\n" for x in (rms_sentence(found), why) if x))
    sys.stdout.write("\n" + "".join(f"{line}\n" for line in sentences(found, quantities)))
    sys.stdout.write(f"written: {', '.join(str(path) for path in written)}\n")
    if quantities.reading != MICROMETRE or quantities.command != VOLT:
        pairs = ((quantities.reading, MICROMETRE), (quantities.command, VOLT))
        stands = [f"1 {unit_text(usual)} for 1 {unit_text(own)}" for own, usual in pairs if own != usual]
        remark(
            f"{written[1]} has {' and '.join(stands)} of the record; `bender diagnose --model {written[0]}` reads the "
            "model in the units of the record"
        )
    for said in filter(None, (delay_sentence(found), doubt_sentence(found), quick_sentence(found))):
        remark(said)
