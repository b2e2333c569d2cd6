"""`bender compare RECORD`: the FMU driven with a record's voltage, laid over the record's displacement."""

import argparse
import sys
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from bender_loop.records.arguments import add_record_arguments

if TYPE_CHECKING:
    from bender_loop.fmu.plant import FmuPlant
    from bender_loop.fmu.watched import WatchedPlant
    from bender_loop.records.compare import Comparison
    from bender_loop.records.record import Record
    from bender_loop.records.replay import Replay
    from bender_loop.shell.progress import Progress

MOST_STEPS = 2e7
"""Of the plant over a record, at some 15 µs each: five minutes."""
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
        help="an FMI 2.0 co-simulation FMU instead of a model: native code that runs with your rights",
    )
    parser.add_argument(
        "--input", metavar="NAME", help="voltage input of the FMU (default: its only input, or `voltage`)"
    )
    parser.add_argument(
        "--output", metavar="NAME", help="displacement output of the FMU (default: its only output, or `displacement`)"
    )
    add_record_arguments(parser)
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
    from bender_loop.errors import InputError
    from bender_loop.records.arguments import record_of
    from bender_loop.records.compare import compare, require_readings
    from bender_loop.records.replay import replay
    from bender_loop.records.sizes import check_sizes, check_work
    from bender_loop.shell.progress import Progress

    if arguments.fmu is not None and arguments.model is not None:
        raise InputError("--fmu and --model name two plants; give one of them")
    arguments.model = "paper" if arguments.model is None else arguments.model
    path: Path = arguments.record
    if arguments.out is None:
        arguments.out = Path("results") / f"compare-{path.stem}"
    record = record_of(arguments, path)
    check_sizes(str(path), record, arguments.untimed)
    require_readings(record.displacement_um)
    if arguments.fmu is None and not arguments.untimed:
        check_work(str(path), float(record.time_s[-1] - record.time_s[0]), _longest_step_s(arguments.model), MOST_STEPS)
    with Progress(f"driving {_subject(arguments)}") as progress, _plant(arguments, progress) as plant:
        replayed = replay(plant, record, input_hold=arguments.input_hold, untimed=arguments.untimed)
    comparison = compare(record.displacement_um, replayed.simulated_um)
    _write(arguments, record, replayed, comparison)
    _print(arguments, comparison)
    return 0


class _Told:
    """An FMU that shows how many steps it has done."""

    def __init__(self, plant: "FmuPlant", progress: "Progress") -> None:
        self._plant, self._progress, self._steps = plant, progress, 0
        self.reset, self.read, self.close = plant.reset, plant.read, plant.close

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def step(self, voltage_V: float, step_s: float) -> float:
        """Advance the FMU."""
        self._steps += 1
        self._progress.update(self._steps, text="steps")
        return self._plant.step(voltage_V, step_s)


def _longest_step_s(model: str) -> float:
    """Return in which steps the plant is computed where the command rests."""
    from bender_loop.errors import InputError
    from bender_plant.model import load_model
    from bender_plant.parameter import ModelError
    from bender_plant.plant import sub_step_bounds_s

    try:
        return sub_step_bounds_s(load_model(model))[1]
    except ModelError as error:
        raise InputError(str(error)) from None


def _plant(arguments: argparse.Namespace, progress: "Progress") -> "_Told | WatchedPlant":
    """Our own FMU in this process, any other one in a process of its own."""
    names = {"input_name": arguments.input, "output_name": arguments.output}
    if arguments.fmu is None:
        from bender_export.build import ensure_plant_fmu
        from bender_loop.fmu.plant import FmuPlant

        return _Told(FmuPlant(ensure_plant_fmu(arguments.model), **names), progress)
    from bender_loop.fmu.watched import NATIVE_CODE, WatchedPlant

    plant = WatchedPlant(arguments.fmu, tell=lambda steps: progress.update(steps, text="steps"), **names)
    sys.stdout.write(f"{NATIVE_CODE}\n")
    return plant


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
