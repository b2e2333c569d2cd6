"""`bender diagnose`: find the disagreement, name what is missing, write the corrected model, its FMU and the report."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bender_discrepancy.conclusion.findings import Findings
    from bender_discrepancy.experiment.profiles import Sine
    from bender_discrepancy.search.result import Diagnosis, Interrupted
    from bender_discrepancy.settings import Settings

HELP = "name the effect that a model lacks, correct the model, show how far the gap shrinks"
EXAMPLE = """\
bender diagnose record.csv
bender diagnose first.csv second.csv --model beam --out results/bench-3
bender diagnose record.csv --columns time=t,voltage=U,displacement=d --units ms,V,mm --json"""

REPORT, DIAGNOSIS, PROFILE = "report.html", "diagnosis.json", "profile.csv"
INTERRUPTED = 130
EXPERIMENT_SEED = 1
# rivals that one experiment is asked to separate; two of three may be the same thing under two names
MOST_SEPARATED = 3
HIGHEST_V = 1000.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the records, how they are read, the model, and where the results go."""
    parser.add_argument(
        "record", type=Path, nargs="+", metavar="RECORD", help="CSV of one bench: time_s, voltage_V, displacement_um"
    )
    parser.add_argument("--model", default="paper", help="a built-in model or a model file (default: paper)")
    parser.add_argument(
        "--input-hold",
        choices=("hold", "linear"),
        default="hold",
        help="the voltage between two rows: held (a supply, default) or straight (a function generator)",
    )
    parser.add_argument(
        "--untimed", action="store_true", help="time is only an order: nothing that depends on it is named"
    )
    parser.add_argument("--columns", metavar="NAMES", help="other names, as time=t,voltage=U,displacement=d")
    parser.add_argument("--units", metavar="UNITS", help="other units of these columns, as ms,V,mm")
    parser.add_argument(
        "--highest-voltage",
        type=float,
        default=None,
        metavar="V",
        help="that the next experiment may ask for (default: no more than the records reached)",
    )
    parser.add_argument(
        "--start",
        choices=("auto", "rest", "motion"),
        default="auto",
        help="how the records begin: from rest, in motion, or as the readings say (default)",
    )
    parser.add_argument(
        "--confidence",
        type=float,
        default=0.99,
        metavar="P",
        help="one minus the error rate of what is said (default: 0.99)",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: results/diagnose-RECORD, of the first record")
    parser.add_argument("--json", action="store_true", help="print diagnosis.json instead of the summary")


def run(arguments: argparse.Namespace) -> int:
    """Diagnose; write diagnosis.json, model.toml, model.fmu and report.html, all of them or none.

    Returns:
        0, whatever the verdict; 130 after an interrupt (Ctrl-C or SIGTERM), with what was ranked until then in
        diagnosis.json, marked partial.

    Raises:
        InputError: the model, a record or the output directory will not do; nothing was written.
        RunError: the corrected FMU could not be driven; nothing was written.
    """
    from bender_compiled.interrupts import ending_alike
    from bender_discrepancy.search.result import Interrupted

    if arguments.out is None:
        arguments.out = Path("results") / f"diagnose-{arguments.record[0].stem}"
    with ending_alike():
        try:
            return _diagnosed(arguments)
        except Interrupted as stop:
            return _kept(stop, arguments.out, [path.name for path in arguments.record])
        except KeyboardInterrupt:
            sys.stderr.write("bender: interrupted before anything was ranked; nothing was written\n")
            return INTERRUPTED


def _diagnosed(arguments: argparse.Namespace) -> int:
    from bender_discrepancy.conclusion.staging import staged
    from bender_discrepancy.records.checks import read_model, read_records, refuse_wrong_units

    paths: list[Path] = arguments.record
    settings = _settings(arguments)
    model = read_model(arguments.model)
    records = read_records(paths, arguments.columns, arguments.units)
    refuse_wrong_units(model, paths, records, settings)
    with staged(arguments.out) as stage:
        text, lines = worked_out(stage, arguments.out, model, records, settings, [path.name for path in paths])
    sys.stdout.write(text if arguments.json else "\n".join(lines) + "\n")
    return 0


def _settings(arguments: argparse.Namespace) -> "Settings":
    from bender_discrepancy.settings import Beginning, Settings
    from bender_loop.errors import InputError

    highest: float | None = arguments.highest_voltage
    if highest is not None and not 0.0 < highest <= HIGHEST_V:
        raise InputError(f"--highest-voltage: found {highest:g}, expected more than 0 and at most {HIGHEST_V:g} V")
    confidence = getattr(arguments, "confidence", 0.99)
    if not 0.5 <= confidence < 1.0:
        raise InputError(f"--confidence: found {confidence:g}, expected from 0.5 to below 1")
    start: Beginning = getattr(arguments, "start", "auto")
    return Settings(arguments.input_hold == "linear", arguments.untimed, highest, start, confidence)


def _kept(stop: "Interrupted", out: Path, names: list[str]) -> int:
    from bender_discrepancy.conclusion.partial import partial_outcome
    from bender_discrepancy.conclusion.staging import staged

    earlier = f"; {REPORT} there is of an earlier run" if (out / REPORT).exists() else ""
    result = partial_outcome(stop.diagnosis, names, stop.searched)
    with staged(out) as stage:
        _write_result(stage, result)
    sys.stderr.write(
        f"bender: interrupted; what was ranked until then is in {out / DIAGNOSIS}, marked partial{earlier}\n"
    )
    return INTERRUPTED


def _write_result(stage: Path, result: dict[str, Any]) -> None:
    import json

    from bender_loop.shell.files import write_atomically

    write_atomically(stage / DIAGNOSIS, json.dumps(result, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def worked_out(
    stage: Path, out: Path, model: Any, records: Sequence[Any], settings: "Settings", names: Sequence[str]
) -> tuple[str, list[str]]:
    """Do the work into a directory; returns diagnosis.json as a terminal shows it, and the lines of the summary.

    Raises:
        Interrupted: by the user, after a first ranking.
        KeyboardInterrupt: before it.
    """
    from bender_discrepancy.search.result import Interrupted
    from bender_discrepancy.workflow import diagnose
    from bender_loop.shell.progress import Progress

    with Progress("diagnose") as bar:
        tell = _Steps(bar)
        tell("reading the records against the model")
        diagnosis = diagnose(model, records, settings, tell)
        try:
            return _written(stage, out, diagnosis, names, tell)
        except KeyboardInterrupt:
            raise Interrupted(diagnosis, searched=True) from None


def _written(stage: Path, out: Path, diagnosis: "Diagnosis", names: Sequence[str], tell: Any) -> tuple[str, list[str]]:
    import json

    import tomli_w

    from bender_discrepancy.conclusion.diagnosis_json import FMU, MODEL, outcome
    from bender_discrepancy.conclusion.findings import find
    from bender_discrepancy.conclusion.gap import measure
    from bender_discrepancy.equation.lead import lead_of
    from bender_discrepancy.report.page import report_page
    from bender_discrepancy.report.summary import summary
    from bender_loop.shell.files import write_atomically

    tell("weighing the evidence")
    findings = find(diagnosis)
    tell("driving the corrected FMU")
    measured = measure(diagnosis, findings.model, findings.calibration, stage / FMU, findings.of_record)
    following = next_experiment(findings, stage, tell)
    if findings.verdict == "unexplained":
        tell("seeking an equation for what is left")
    lead = lead_of(findings.diagnosis, findings.verdict)
    result = outcome(findings, measured, names, following, lead)
    tell("drawing the report")
    write_atomically(stage / REPORT, report_page(findings, measured, result, lead))
    if measured.is_worse:
        (stage / FMU).unlink()
    else:
        write_atomically(stage / MODEL, tomli_w.dumps(findings.model.to_table()))
    _write_result(stage, result)
    return json.dumps(result, indent=2, allow_nan=False) + "\n", list(summary(findings, measured, result, out))


class _Steps:
    """Counts the steps of the work and shows each one's sentence."""

    def __init__(self, bar: Any) -> None:
        self._bar, self._done = bar, 0

    def __call__(self, text: str) -> None:
        self._done += 1
        self._bar.update(self._done, None, text)


def next_experiment(findings: "Findings", stage: Path, tell: Any = None) -> dict[str, Any] | None:
    """Design the experiment that separates the rivals of an ambiguous verdict, and write its profile.

    Args:
        findings: what was found.
        stage: directory that gets the profile.
        tell: is told what is being done.

    Returns:
        {"why": sentence, "profile": file name, "tells_apart": whether it would}; None where no experiment is needed,
        or none is known.
    """
    if findings.verdict != "ambiguous" or len(findings.leaders) < 2:
        return None
    import numpy as np

    from bender_discrepancy.experiment.design import design
    from bender_discrepancy.experiment.profiles import seen_limits
    from bender_loop.shell.files import write_atomically

    if tell is not None:
        tell("designing the next experiment")
    diagnosis = findings.diagnosis
    found, noise = None, diagnosis.found.noise_um
    limits = seen_limits([x.voltage_V for x in diagnosis.records], diagnosis.settings.highest_V)
    for count in (MOST_SEPARATED, 2):
        rivals = [x.hypothesis for x in findings.leaders[:count]]
        rng = np.random.default_rng(EXPERIMENT_SEED)
        found = design(diagnosis.bench.base, rivals, noise, _step_s(diagnosis), rng, limits, _sine(diagnosis))
        if len(rivals) == 2 or (found is not None and found.distance_um > noise):
            break
    if found is None:
        return None
    rows = zip(found.time_s.tolist(), found.voltage_V.tolist(), strict=True)
    write_atomically(stage / PROFILE, "time_s,voltage_V\n" + "".join(f"{t!r},{v!r}\n" for t, v in rows))
    return {"why": found.why, "profile": PROFILE, "tells_apart": found.tells_apart}


def _sine(diagnosis: "Diagnosis") -> "Sine | None":
    """Return the sine that the records were driven with, None where it was anything else."""
    import numpy as np

    from bender_discrepancy.experiment.profiles import Sine
    from bender_discrepancy.records.excitation import sine_frequency_Hz
    from bender_discrepancy.records.observations import only_one_sine

    if not only_one_sine(diagnosis.bench.observations):
        return None
    x = diagnosis.bench.observations[0]
    low, high = float(np.min(x.command_V)), float(np.max(x.command_V))
    return Sine(sine_frequency_Hz(x.time_s, x.command_V), 0.5 * (low + high), 0.5 * (high - low))


def _step_s(diagnosis: "Diagnosis") -> float:
    """Return the time between rows of the next experiment: that of the first record, of a camera where it has none."""
    import numpy as np

    camera_s = 1.0 / 30.0
    return camera_s if diagnosis.settings.untimed else float(np.median(np.diff(diagnosis.records[0].time_s)))
