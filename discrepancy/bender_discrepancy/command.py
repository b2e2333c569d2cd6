"""`bender diagnose`: find the disagreement, name what is missing, write the corrected model, its FMU and the report."""

import argparse
import gc
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from bender_discrepancy.foreign.suspects import add_suspect_argument
from bender_loop.fmu.start_values import add_set_argument
from bender_loop.records.arguments import add_further_argument, add_port_arguments, add_record_arguments

if TYPE_CHECKING:
    from bender_discrepancy.diagnosis import Diagnosis
    from bender_discrepancy.report.chart_process import ChartProcess
    from bender_inference.fitting.journal import Journal
    from bender_inference.search.result import SearchResult
    from bender_inference.settings import Settings

HELP = "name the physical effect that a model lacks, correct the model, measure the remaining gap"
EXAMPLE = """\
bender diagnose record.csv
bender diagnose first.csv second.csv --model beam --out results/bench-3
bender diagnose record.csv --fmu my-actuator.fmu --input u --output y --suspect stiffness=0.5:2
bender diagnose record.csv --fmu my-arm.fmu --output tip --output force --further-input load
bender diagnose record.csv --columns time=t,voltage=U,displacement=d --units ms,V,mm --json"""


class Foreign(NamedTuple):
    """An FMU as the model: its file, the names of its input and output where they were told, and what was set."""

    fmu: Path
    input: str | None
    output: str | None
    parameters: dict[str, float]
    suspects: tuple[str, ...] = ()


PARTIAL = "diagnosis.partial.json"
"""Where the name of a whole result is taken by an earlier run."""
INTERRUPTED = 130


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the records, how they are read, the model, and where the results go."""
    parser.add_argument(
        "record",
        type=Path,
        nargs="+",
        metavar="RECORD",
        help="records of one bench with time_s, voltage_V, displacement_um: CSV in any layout, Parquet, MAT …",
    )
    parser.add_argument(
        "--model",
        help="model of your device: model file or built-in (default: paper, the film actuator of Musa and Wejinya "
        "2024, 50 V for 23 µm); auto for a device without one: linear structure and effects compete",
    )
    parser.add_argument(
        "--fmu",
        type=Path,
        metavar="FILE",
        help="a co-simulation FMU (FMI 2.0 or 3.0) instead of a model: native code that runs with your rights",
    )
    add_port_arguments(parser, several=True)
    add_further_argument(parser)
    parser.add_argument(
        "--input-hold",
        choices=("auto", "hold", "linear", "smooth"),
        default="auto",
        help="voltage between two rows: held (a supply), linear (a generator) or smooth (band-limited); default: held, "
        "unless the records fit another far better",
    )
    parser.add_argument(
        "--untimed", action="store_true", help="the times are only an order; no effect that depends on time is named"
    )
    add_set_argument(parser)
    add_suspect_argument(parser)
    add_record_arguments(parser)
    parser.add_argument(
        "--highest-voltage",
        type=float,
        default=None,
        metavar="V",
        help="limit of the next experiment (default: what the records reached)",
    )
    parser.add_argument(
        "--start",
        choices=("auto", "rest", "motion"),
        default="auto",
        help="how the records begin: from rest, in motion, or as the readings say (default)",
    )
    parser.add_argument(
        "--same-zero",
        action="store_true",
        help="the sensor was not zeroed between the records (default: each has an offset of its own)",
    )
    parser.add_argument(
        "--confidence",
        type=float,
        default=0.99,
        metavar="P",
        help="one minus the accepted rate of wrong names (default: 0.99)",
    )
    parser.add_argument(
        "--relevant",
        default="0.5%",
        metavar="SHARE",
        help="share of the stroke below which a residual does not matter (default: 0.5%%)",
    )
    parser.add_argument(
        "--with-record-effects",
        action="store_true",
        help="keep drift, ageing and hum in the corrected model (default: reported only)",
    )
    parser.add_argument(
        "--resume",
        type=Path,
        metavar="DIR",
        help="continue the interrupted diagnosis in DIR (same records, model and options)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="default: results/diagnose-RECORD, of the first record, with a number where it exists",
    )


def run(arguments: argparse.Namespace) -> int:
    """Diagnose; write diagnosis.json, model.toml, model.fmu and report.html, all of them or none.

    Returns:
        0, whatever the verdict; 130 after an interrupt (Ctrl-C or SIGTERM), with what was ranked until then in
        diagnosis.json, marked partial.

    Raises:
        InputError: the model, a record or the output directory will not do; nothing was written.
        RunError: an FMU failed; of the results only what was ranked until then was written, marked partial.
    """
    from bender_discrepancy.report.chart_process import ChartProcess

    with ChartProcess() as chart_process:
        if len(arguments.output or ()) < 2:
            chart_process.begin()  # it imports what it needs while this process does
        return _run(arguments, chart_process)


def _run(arguments: argparse.Namespace, chart_process: "ChartProcess") -> int:
    from bender_compiled.interrupts import signals_as_interrupt
    from bender_inference.fitting.journal import Journal, keeping, read_journal
    from bender_inference.search.result import BrokenOffError, Interrupted
    from bender_loop.errors import RunError
    from bender_loop.shell.files import unused
    from bender_loop.shell.run import remark

    journal = Journal() if arguments.resume is None else read_journal(arguments.resume)
    if arguments.out is None:
        arguments.out = arguments.resume or unused(Path("results") / f"diagnose-{arguments.record[0].stem}")
    with signals_as_interrupt():
        try:
            with keeping(journal):
                status = _diagnosed(arguments, chart_process)
        except Interrupted as stop:
            kept = _kept(stop.search, stop.searched, arguments, journal)
            sys.stderr.write(f"bender: interrupted; what was ranked until then is in {kept}\n")
            return INTERRUPTED
        except BrokenOffError as stop:
            kept = _kept(stop.search, True, arguments, journal)
            raise RunError(f"{stop}; what was ranked until then is in {kept}") from None
        except KeyboardInterrupt:
            return _kept_unranked(arguments.out, journal)
    if arguments.resume is not None and not journal.reused:
        remark(f"{arguments.resume} holds nothing for these records, model and options: started from the beginning")
    return status


def _kept_unranked(out: Path, journal: "Journal") -> int:
    from bender_discrepancy.output_folder import all_or_no_files
    from bender_inference.fitting.journal import UNFINISHED
    from bender_loop.shell.files import write_atomically
    from bender_loop.shell.run import going_on

    kept = "nothing was written"
    if journal.entries:
        with all_or_no_files(out) as stage:
            write_atomically(stage / UNFINISHED, journal.to_json())
        kept = f"go on with: {going_on('--resume', out)}"
    sys.stderr.write(f"bender: interrupted before anything was ranked; {kept}\n")
    return INTERRUPTED


def _diagnosed(arguments: argparse.Namespace, chart_process: "ChartProcess") -> int:
    from bender_discrepancy.diagnosis import DIAGNOSIS, FILES
    from bender_discrepancy.output_folder import all_or_no_files
    from bender_inference.fitting.journal import UNFINISHED
    from bender_inference.records.checks import read_model
    from bender_inference.structures import AUTO
    from bender_loop.errors import InputError
    from bender_loop.fmu.start_values import start_values
    from bender_loop.records.arguments import record_of
    from bender_loop.records.further import parsed
    from bender_loop.shell.files import keep_earlier
    from bender_report.drawing import can_draw, no_pictures

    settings = _settings(arguments)
    values = start_values(arguments)
    if arguments.fmu is None and (arguments.input or arguments.output or values or arguments.suspect):
        raise InputError(
            "--input, --output, --set, --suspect: found without --fmu, expected with it: they name variables of an FMU"
        )
    if arguments.fmu is not None and arguments.model is not None:
        raise InputError("--fmu and --model both name a model; give only one")
    columns = parsed(arguments.output, "--output")
    if len(columns) > 1:
        from bender_discrepancy.foreign.outputs_command import diagnosed_outputs

        return diagnosed_outputs(arguments, columns, values, settings)
    name, reading = next(iter(columns.items()), (None, None))
    if arguments.fmu is not None:
        model: Any = Foreign(arguments.fmu, arguments.input, name, values, tuple(arguments.suspect))
    else:
        named = "paper" if arguments.model is None else arguments.model
        model = None if named == AUTO else read_model(named)
    own = reading if arguments.output and "=" in arguments.output[0] else None
    records = [record_of(arguments, path, own) for path in arguments.record]
    with all_or_no_files(arguments.out) as stage:
        names = [str(path) for path in arguments.record]
        diagnosis = diagnose_into(stage, model, records, settings, names, chart_process)
        lines = diagnosis.summary(arguments.out)
        made = {path.name for path in stage.iterdir()}
        if arguments.resume is None:
            keep_earlier(arguments.out, DIAGNOSIS, {*FILES, PARTIAL, UNFINISHED} - {DIAGNOSIS})
    for name in {*FILES, PARTIAL, UNFINISHED} - made:  # of an earlier run
        (arguments.out / name).unlink(missing_ok=True)
    pictures = [] if can_draw() else [f"no pictures in the report: {no_pictures()}"]
    sys.stdout.write("\n".join([*lines, *pictures]) + "\n")
    return 0


def _settings(arguments: argparse.Namespace) -> "Settings":
    from bender_inference.settings import HIGHEST_V, LEAST_CONFIDENCE, Settings
    from bender_loop.errors import InputError

    highest: float | None = arguments.highest_voltage
    if highest is not None and not 0.0 < highest <= HIGHEST_V:
        raise InputError(f"--highest-voltage: found {highest:g}, expected more than 0 and at most {HIGHEST_V:g} V")
    confidence: float = arguments.confidence
    if not LEAST_CONFIDENCE <= confidence < 1.0:
        raise InputError(f"--confidence: found {confidence:g}, expected from {LEAST_CONFIDENCE:g} to below 1")
    settings = Settings(
        untimed=arguments.untimed,
        highest_V=highest,
        start=arguments.start,
        confidence=confidence,
        with_record_effects=arguments.with_record_effects,
        relevant=_share(arguments.relevant),
        same_zero=arguments.same_zero,
    )
    return settings.between_rows(arguments.input_hold)


def _share(text: str) -> float:
    """0.005 or 0.5%."""
    from bender_loop.errors import InputError

    number, percent = (text[:-1], 0.01) if text.endswith("%") else (text, 1.0)
    try:
        share = percent * float(number)
    except ValueError:
        share = math.nan
    if not 0.0 <= share < 1.0:
        raise InputError(f"--relevant: found {text!r}, expected a share of the stroke, such as 0.5% or 0.005")
    return share


def _kept(search: "SearchResult", searched: bool, arguments: argparse.Namespace, journal: "Journal") -> str:
    """Keep what was ranked; returns where, in words."""
    from bender_discrepancy.conclusion.partial import partial_outcome
    from bender_discrepancy.diagnosis import DIAGNOSIS, REPORT
    from bender_discrepancy.output_folder import all_or_no_files
    from bender_inference.fitting.journal import UNFINISHED
    from bender_loop.shell.files import write_atomically, write_result
    from bender_loop.shell.run import going_on

    out, names = arguments.out, [path.name for path in arguments.record]
    kept = _is_complete(out / DIAGNOSIS)
    name = PARTIAL if kept else DIAGNOSIS
    earlier = f"; {DIAGNOSIS if kept else REPORT} there is of an earlier run" if kept or (out / REPORT).exists() else ""
    result = partial_outcome(search, names, searched)
    with all_or_no_files(out) as stage:
        write_result(stage / name, result)
        write_atomically(stage / UNFINISHED, journal.to_json())
    return f"{out / name}, marked partial{earlier}; go on with: {going_on('--resume', out)}"


def _is_complete(path: Path) -> bool:
    """Return whether a file is there that is not the partial result of an earlier interrupt."""
    import json

    if not path.exists():
        return False
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return True
    return not (isinstance(found, dict) and found.get("partial"))


def diagnose_into(
    stage: Path,
    model: Any,
    records: Sequence[Any],
    settings: "Settings",
    names: Sequence[str],
    chart_process: "ChartProcess | None" = None,
) -> "Diagnosis":
    """Diagnose, with a bar of progress, and write everything into a directory; a process may draw some of its charts.

    Raises:
        InputError, RunError: as `diagnose` raises them.
        Interrupted: by the user, after a first ranking.
        KeyboardInterrupt: before it.
    """
    from bender_discrepancy.workflow import diagnose
    from bender_inference.search.result import Interrupted
    from bender_loop.shell.progress import Progress
    from bender_loop.shell.run import remark

    # what has been imported stays: no collection of garbage need look through it
    gc.freeze()
    with Progress("diagnose") as bar:
        tell = _Steps(bar, chart_process)
        if isinstance(model, Foreign):
            from bender_discrepancy.foreign.diagnose import diagnose_fmu

            diagnosis = diagnose_fmu(*model[:3], records, settings, tell, names, model.parameters, model.suspects)
        else:
            diagnosis = diagnose(model, records, settings, tell, names, remark=remark)
        try:
            tell("drawing the report")
            diagnosis.write(stage, chart_process=chart_process)
        except KeyboardInterrupt:
            raise Interrupted(diagnosis.findings.search, searched=True) from None
    return diagnosis


STAGES = (
    ("reading", "starting the FMU", "driving the FMU with", "measuring the FMU", "fitting a linear model"),
    ("step", "another beginning", "trying others", "putting what was found"),
    ("weighing",),
    ("building the corrected", "driving the corrected", "calibration alone"),
    ("designing", "seeking"),
    ("drawing",),
)
"""How the sentences of each part of the work begin, in the order of the work."""
WAITING = "driving the corrected"


class _Steps:
    """Shows which part of the work is going on, and its sentence."""

    def __init__(self, bar: Any, chart_process: "ChartProcess | None") -> None:
        self._bar, self._chart_process, self._stage = bar, chart_process, 1

    def __call__(self, text: str) -> None:
        self._stage = next((k for k, words in enumerate(STAGES, 1) if text.startswith(words)), self._stage)
        if self._chart_process is not None and text.startswith(WAITING):
            self._chart_process.get_ready()
        self._bar.update(self._stage, len(STAGES), text)
