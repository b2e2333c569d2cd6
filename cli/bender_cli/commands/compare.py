"""`bender compare RECORD`: the FMU driven with a record's voltage, laid over the record's displacement."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bender_loop.records.compare import Comparison
    from bender_loop.records.record import Record
    from bender_loop.records.replay import Replay

HELP = "overlay the simulation on a measured record"
EXAMPLE = """\
bender compare record.csv
bender compare record.csv --model beam --columns time=t,voltage=U,displacement=d --units ms,V,mm
bender compare record.csv --fmu mine.fmu --input voltage --output displacement"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the record, how it is read, the model, and where the results go."""
    parser.add_argument("record", type=Path, metavar="RECORD", help="CSV: time_s, voltage_V, displacement_um")
    parser.add_argument("--model", help="model file or built-in model (default: paper, one particular device)")
    parser.add_argument("--fmu", type=Path, metavar="FILE", help="an FMI 2.0 co-simulation FMU instead of a model")
    parser.add_argument(
        "--input", metavar="NAME", help="voltage input of the FMU (default: its only input, or `voltage`)"
    )
    parser.add_argument(
        "--output", metavar="NAME", help="displacement output of the FMU (default: its only output, or `displacement`)"
    )
    parser.add_argument(
        "--columns", metavar="NAMES", help="names of the columns, such as time=t,voltage=U,displacement=d"
    )
    parser.add_argument("--units", metavar="UNITS", help="units of these columns, such as ms,V,mm")
    parser.add_argument(
        "--input-hold",
        choices=("hold", "linear"),
        default="hold",
        help="voltage between two rows: held (a supply; default) or linear (a function generator)",
    )
    parser.add_argument(
        "--untimed", action="store_true", help="the times are only an order; each row is a settled pair"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: results/compare-RECORD")


def run(arguments: argparse.Namespace) -> int:
    """Print the figures, write comparison.json and overlay.png.

    Raises:
        InputError: both an FMU and a model are named, or the record or the plant cannot be used.
        RunError: the plant failed.
    """
    from bender_export.build import ensure_plant_fmu
    from bender_loop.errors import InputError
    from bender_loop.fmu.plant import FmuPlant
    from bender_loop.records.compare import compare
    from bender_loop.records.record import read_record
    from bender_loop.records.replay import replay
    from bender_loop.records.sizes import check_sizes

    if arguments.fmu is not None and arguments.model is not None:
        raise InputError("--fmu and --model name two plants; give one of them")
    arguments.model = arguments.model or "paper"
    path: Path = arguments.record
    if arguments.out is None:
        arguments.out = Path("results") / f"compare-{path.stem}"
    record = read_record(path, arguments.columns, arguments.units)
    check_sizes(str(path), record, arguments.untimed)
    if arguments.fmu is not None:
        from bender_loop.fmu.check.trial_process import require_sound_start

        require_sound_start(arguments.fmu)
    fmu = arguments.fmu or ensure_plant_fmu(arguments.model)
    with FmuPlant(fmu, input_name=arguments.input, output_name=arguments.output) as plant:
        replayed = replay(plant, record, input_hold=arguments.input_hold, untimed=arguments.untimed)
    comparison = compare(record.displacement_um, replayed.simulated_um)
    _write(arguments, record, replayed, comparison)
    _print(arguments, comparison)
    return 0


def _write(arguments: argparse.Namespace, record: "Record", replayed: "Replay", comparison: "Comparison") -> None:
    import json
    from dataclasses import asdict

    import numpy as np

    from bender_loop.records.overlay import Overlay, draw_overlay
    from bender_loop.shell.files import prepare_directory, write_atomically

    overlay = Overlay(
        title=f"{arguments.record.name} over {_subject(arguments)}",
        axis=np.arange(len(record), dtype=np.float64) if arguments.untimed else record.time_s,
        axis_label="row" if arguments.untimed else "time (s)",
        acting_V=replayed.acting_V,
        measured_um=record.displacement_um,
        simulated_um=replayed.simulated_um,
    )
    facts = {
        "record": str(arguments.record),
        "model": str(arguments.model) if arguments.fmu is None else None,
        "fmu": None if arguments.fmu is None else str(arguments.fmu),
        "input_hold": arguments.input_hold,
        "start": replayed.start,
        **asdict(comparison),
    }
    picture = draw_overlay(overlay, comparison)
    out = prepare_directory(arguments.out)
    write_atomically(out / "comparison.json", json.dumps(facts, indent=2, allow_nan=False) + "\n")
    write_atomically(out / "overlay.png", picture)


def _subject(arguments: argparse.Namespace) -> str:
    return f"the model {Path(arguments.model).stem}" if arguments.fmu is None else arguments.fmu.name


def _print(arguments: argparse.Namespace, comparison: "Comparison") -> None:
    from bender_loop.shell.progress import print_table

    cases = {"as given": comparison.before, "gain and offset recalibrated": comparison.recalibrated}
    rows = [[name, x.rms_um, x.nrmse_percent, x.fit_percent] for name, x in cases.items()]
    print_table(f"{arguments.record} and {_subject(arguments)}", ["model", "rms_um", "nrmse_%", "fit_%"], rows)
    line = comparison.recalibration
    lost = f", {comparison.lost_rows} of them lost" if comparison.lost_rows else ""
    sys.stdout.write(
        f"recalibration: gain x {line.gain:.4g}, offset {line.offset_um:+.4g} um, over {comparison.rows} rows{lost}\n"
        f"written: {arguments.out / 'comparison.json'}, {arguments.out / 'overlay.png'}\n"
    )
