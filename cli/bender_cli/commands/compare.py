"""`bender compare RECORD`: the FMU driven with a record's voltage, laid over the record's displacement."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from piezo_bender import RecordComparison

HELP = "lay the simulation over a measured record"
EXAMPLE = """\
bender compare record.csv
bender compare record.csv --model beam --columns time=t,voltage=U,displacement=d --units ms,V,mm
bender compare record.csv --fmu mine.fmu --input voltage --output displacement"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the record, how it is read, the model, and where the results go."""
    parser.add_argument("record", type=Path, metavar="RECORD", help="CSV: time_s, voltage_V, displacement_um")
    parser.add_argument("--model", help="a built-in model or a model file (default: paper)")
    parser.add_argument("--fmu", type=Path, metavar="FILE", help="any FMI 2.0 co-simulation FMU instead of a model")
    parser.add_argument("--input", metavar="NAME", help="its input, a voltage (default: the only one, or `voltage`)")
    parser.add_argument(
        "--output", metavar="NAME", help="its output, a displacement (default: the only one, or `displacement`)"
    )
    parser.add_argument("--columns", metavar="NAMES", help="other names, as time=t,voltage=U,displacement=d")
    parser.add_argument("--units", metavar="UNITS", help="other units of these columns, as ms,V,mm")
    parser.add_argument(
        "--input-hold",
        choices=("hold", "linear"),
        default="hold",
        help="the voltage between two rows: held (a supply, default) or straight (a function generator)",
    )
    parser.add_argument(
        "--untimed", action="store_true", help="time is only an order: each row is a settled pair of readings"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: results/compare-RECORD")


def run(arguments: argparse.Namespace) -> int:
    """Print the figures, write comparison.json and overlay.png.

    Raises:
        InputError: both an FMU and a model are named, or the record or the plant cannot be used.
        RunError: the plant failed.
    """
    from piezo_bender import compare

    if arguments.out is None:
        arguments.out = Path("results") / f"compare-{arguments.record.stem}"
    found = compare(
        arguments.record,
        arguments.model,
        fmu=arguments.fmu,
        input_name=arguments.input,
        output_name=arguments.output,
        input_hold=arguments.input_hold,
        untimed=arguments.untimed,
        columns=arguments.columns,
        units=arguments.units,
    )
    found.save(arguments.out)
    _print(arguments, found)
    return 0


def _print(arguments: argparse.Namespace, found: "RecordComparison") -> None:
    from bender_loop.shell.progress import print_table

    x = found.comparison
    cases = {"as given": x.before, "gain and offset recalibrated": x.recalibrated}
    rows = [[name, y.rms_um, y.nrmse_percent, y.fit_percent] for name, y in cases.items()]
    print_table(f"{arguments.record} and {found.subject}", ["model", "rms_um", "nrmse_%", "fit_%"], rows)
    line = x.recalibration
    lost = f", {x.lost_rows} of them lost" if x.lost_rows else ""
    sys.stdout.write(
        f"recalibration: gain x {line.gain:.4g}, offset {line.offset_um:+.4g} um, over {x.rows} rows{lost}\n"
        f"written: {arguments.out / 'comparison.json'}, {arguments.out / 'overlay.png'}\n"
    )
