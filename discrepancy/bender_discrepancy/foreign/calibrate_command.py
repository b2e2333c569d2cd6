"""`bender calibrate-model RECORD... --fmu F --suspect NAME`: parameters of an FMU from records, with no effects."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bender_discrepancy.foreign.suspects import add_suspect_argument
from bender_loop.fmu.start_values import add_set_argument
from bender_loop.records.arguments import add_further_argument, add_port_arguments, add_record_arguments
from bender_report.wording import unit_text

if TYPE_CHECKING:
    from bender_discrepancy.foreign.calibration import Calibrated
    from bender_loop.tables.quantities import Quantities

HELP = "fit parameters of an FMU to records: values, intervals, and what the records do not determine"
EXAMPLE = """\
bender calibrate-model record.csv --fmu motor.fmu --suspect friction --suspect inertia=0.01:0.1
bender calibrate-model first.csv second.csv --fmu motor.fmu --suspect tunable --free-reading"""
RESULT = "calibration.json"
INTERVAL = 1.959963984540054


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the records, how they are read, the FMU, the suspects, and where the results go."""
    parser.add_argument(
        "record", type=Path, nargs="+", metavar="RECORD", help="records of one device, as `diagnose` reads them"
    )
    parser.add_argument(
        "--fmu",
        type=Path,
        required=True,
        metavar="FILE",
        help="co-simulation FMU (FMI 2.0 or 3.0): native code that runs with your rights",
    )
    add_port_arguments(parser)
    add_suspect_argument(parser)
    add_set_argument(parser)
    parser.add_argument("--free-reading", action="store_true", help="fit gain and offset of the reading as well")
    parser.add_argument(
        "--input-hold",
        choices=("hold", "linear", "smooth"),
        default="hold",
        help="course of the input between two rows",
    )
    parser.add_argument("--untimed", action="store_true", help="the times are only an order")
    add_further_argument(parser)
    add_record_arguments(parser)
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: results/calibrate-RECORD")
    parser.add_argument("--json", action="store_true", help="print calibration.json instead of the table")


def run(arguments: argparse.Namespace) -> int:
    """Fit, print, write calibration.json and the parameters as `parameters.ssv`; all of them or none.

    Raises:
        InputError: a record, the FMU or an option cannot be used.
        RunError: the FMU fails, crashes or hangs.
    """
    from bender_discrepancy.output_folder import all_or_no_files
    from bender_export.system import parameter_file
    from bender_loop.shell.files import keep_earlier, result_text, unused, write_atomically

    out: Path = arguments.out or unused(Path("results") / f"calibrate-{arguments.record[0].stem}")
    with all_or_no_files(out) as stage:
        found, quantities = _calibrated(arguments)
        told = facts(found, arguments.fmu, quantities)
        text = result_text(told)
        write_atomically(stage / RESULT, text)
        write_atomically(stage / "parameters.ssv", parameter_file("calibrated", {"": found.values()}))
        keep_earlier(out, RESULT, ["parameters.ssv"])
    sys.stdout.write(text if arguments.json else "\n".join([*_lines(told), f"written: {out / RESULT}"]) + "\n")
    return 0


def _calibrated(arguments: argparse.Namespace) -> "tuple[Calibrated, Quantities]":
    from bender_discrepancy.foreign.calibration import calibrate_fmu
    from bender_loop.errors import InputError
    from bender_loop.fmu.start_values import start_values
    from bender_loop.records.arguments import record_of
    from bender_loop.records.common_units import in_units_of
    from bender_loop.shell.progress import Progress

    if not arguments.suspect:
        raise InputError("--suspect: found none, expected the name of a parameter, or `tunable`")
    names = [str(path) for path in arguments.record]
    records = in_units_of([record_of(arguments, path) for path in arguments.record], None, names)
    with Progress("calibrate-model") as bar:
        found = calibrate_fmu(
            arguments.fmu,
            records,
            arguments.suspect,
            names=names,
            input_name=arguments.input,
            output_name=arguments.output,
            parameters=start_values(arguments),
            input_hold=arguments.input_hold,
            untimed=arguments.untimed,
            free_reading=arguments.free_reading,
            tell=lambda runs: bar.update(runs, None, "driving the FMU"),
        )
    return found, records[0].quantities


def facts(found: "Calibrated", fmu: Path | str, quantities: "Quantities") -> dict[str, Any]:
    """Return the content of `calibration.json`."""
    from bender_discrepancy.conclusion.diagnosis_json import in_own_units

    parameters = {
        x.suspect.name: {
            "before": x.suspect.given,
            "after": x.value,
            "unit": x.suspect.unit,
            "std": x.std,
            "interval_95": [x.value - INTERVAL * x.std, x.value + INTERVAL * x.std],
            "range": [x.suspect.low, x.suspect.high],
            "at_the_end_of_its_range": x.at_the_end,
            "is_off": x.is_off,
        }
        for x in found.parameters
    }
    told = {
        "fmu": str(fmu),
        "parameters": parameters,
        "unseen": found.unseen,
        "act_only_together": [list(x) for x in found.combinations],
        "reading": {"gain": found.gain, "offsets_um": list(found.offsets_um)},
        "gap": {
            "before": {"rms_um": found.before_rms_um},
            "after": {"rms_um": found.rms_um},
            "noise_floor_um": found.noise_um,
            "held_out": True,
        },
        "runs": found.runs,
    }
    return in_own_units(told, quantities)


def _lines(told: dict[str, Any]) -> list[str]:
    lines = []
    for name, x in told["parameters"].items():
        unit = "" if x["unit"] == "1" else f" {unit_text(x['unit'])}"
        end = ", at the end of its range" if x["at_the_end_of_its_range"] else ""
        lines.append(f"{name}: {x['before']:.6g} to {x['after']:.6g} ± {INTERVAL * x['std']:.2g}{unit} (95 %){end}")
    lines += [f"{name}: left as it is: {why}" for name, why in told["unseen"].items()]
    lines += [f"only together: {', '.join(x)}" for x in told["act_only_together"]]
    gap, of = told["gap"], unit_text(told["unit"])
    lines.append(
        f"gap on held-out rows: {gap['before']['rms']:.4g} to {gap['after']['rms']:.4g} {of} rms, noise "
        f"{gap['noise_floor']:.4g} {of}"
    )
    return lines
