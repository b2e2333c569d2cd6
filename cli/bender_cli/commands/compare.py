"""`bender compare RECORD`: the FMU driven with a record's voltage, laid over the record's displacement."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from bender_loop.fmu.start_values import add_set_argument
from bender_loop.records.arguments import add_further_argument, add_port_arguments, add_record_arguments

if TYPE_CHECKING:
    from piezo_bender import RecordComparison

HELP = "overlay the simulation on a measured record"
EXAMPLE = """\
bender compare record.csv
bender compare record.csv --model beam --columns time=t,voltage=U,displacement=d --units ms,V,mm
bender compare record.csv --fmu mine.fmu --input voltage --output displacement"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the record, how it is read, the model, and where the results go."""
    parser.add_argument("record", type=Path, metavar="RECORD", help="CSV: time_s, voltage_V, displacement_um")
    parser.add_argument("--model", help="model file or built-in model (default: paper, one particular device)")
    parser.add_argument(
        "--fmu",
        type=Path,
        metavar="FILE",
        help="a co-simulation FMU (FMI 2.0 or 3.0) instead of a model: native code that runs with your rights",
    )
    add_port_arguments(parser)
    add_set_argument(parser)
    add_further_argument(parser)
    add_record_arguments(parser)
    parser.add_argument(
        "--input-hold",
        choices=("hold", "linear", "smooth"),
        default="hold",
        help="voltage between two rows: held (a supply; default), linear (a generator) or smooth (band-limited)",
    )
    parser.add_argument(
        "--untimed", action="store_true", help="times only give the order; each row is a voltage and a reading at rest"
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="default: results/compare-RECORD, with a number where it exists"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the figures, write comparison.json and overlay.png.

    Raises:
        InputError: both an FMU and a model are named, or the record or the plant cannot be used.
        RunError: the plant failed.
    """
    from bender_loop.errors import InputError, RunError
    from bender_loop.fmu.process.watched import NATIVE_CODE
    from bender_loop.fmu.start_values import start_values
    from bender_loop.records.arguments import record_of
    from bender_loop.records.replay import steps_of_replay
    from bender_loop.shell.files import check_directory, keep_earlier, unused
    from bender_loop.shell.progress import Progress
    from piezo_bender import compare
    from piezo_bender.records import LoadedRecord

    if arguments.fmu is not None and arguments.model is not None:
        raise InputError("--fmu and --model both name a plant; give only one")
    path: Path = arguments.record
    if arguments.out is None:
        arguments.out = unused(Path("results") / f"compare-{path.stem}")
    check_directory(arguments.out)
    record = LoadedRecord(record_of(arguments, path), str(path))
    if arguments.fmu is not None:
        sys.stdout.write(f"{NATIVE_CODE}\n")
    total = None if arguments.untimed else steps_of_replay(record.record, arguments.input_hold)
    try:
        with Progress(f"driving {_subject(arguments)}") as progress:
            found = compare(
                record,
                arguments.model,
                fmu=arguments.fmu,
                input_name=arguments.input,
                output_name=arguments.output,
                input_hold=arguments.input_hold,
                untimed=arguments.untimed,
                parameters=start_values(arguments),
                progress=lambda steps: progress.update(steps, total, "steps"),
            )
    except (InputError, RunError) as error:
        # here they are options, as the message had them at first
        raise error.__cause__ if isinstance(error.__cause__, InputError | RunError) else error from None
    keep_earlier(arguments.out, "comparison.json", ["overlay.png"])
    found.save(arguments.out)
    _print(arguments, found)
    return 0


def _subject(arguments: argparse.Namespace) -> str:
    from piezo_bender.comparisons import model_words

    return model_words(arguments.model or "paper") if arguments.fmu is None else arguments.fmu.name


def _print(arguments: argparse.Namespace, found: "RecordComparison") -> None:
    from bender_loop.shell.progress import print_table
    from bender_report.drawing import can_draw, no_pictures
    from bender_report.wording import unit_text

    x, unit = found.comparison, found.record.record.quantities.reading
    cases = {"as given": x.before, "gain and offset recalibrated": x.recalibrated}
    rows = [[name, y.rms_um, y.nrmse_percent, y.fit_percent] for name, y in cases.items()]
    print_table(f"{arguments.record} and {found.subject}", ["model", f"rms_{unit}", "nrmse_%", "fit_%"], rows)
    line = x.recalibration
    read = f"{x.rows - x.lost_rows} of {x.rows} rows, which have a reading" if x.lost_rows else f"all {x.rows} rows"
    sys.stdout.write("".join(f"{x}\n" for x in (x.question, found.remark) if x))
    drawn = f", {arguments.out / 'overlay.png'}" if can_draw() else f"\n{no_pictures()}"
    sys.stdout.write(
        f"recalibration: gain × {line.gain:.4g}, offset {line.offset_told_um(x.before.rms_um):+.4g} {unit_text(unit)}, "
        f"rms of {read}\n"
        f"written: {arguments.out / 'comparison.json'}{drawn}\n"
    )
