"""`bender benchmark rigs`: other people's rigs, from their records alone to a diagnosis of the model made from them."""

import argparse
import math
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from bender_studies.benchmarks.records_at_hand import DATA, data_folder, missing_of, refuse_missing, wanted

if TYPE_CHECKING:
    from bender_discrepancy.diagnosis import Diagnosis
    from bender_loop.records.drive import InputHold
    from bender_loop.records.record import Record

HELP = "other people's rigs: the first model of their records, what the diagnosis names, and the residual"
COLUMNS = ("rig", "named", "complete", "linear", "corrected", "bound", "met", "s")


@dataclass(frozen=True, slots=True)
class Rig:
    """One rig and what its diagnosis is held to.

    Attributes:
        name: for the table.
        file: of the record that is fitted.
        unit: of the readings.
        columns: names of the columns; None for those of a record.
        units: of these; None for those of a record.
        hold: the input between two rows.
        fitted_rows: of the file; the rows after them are judged. None for all of them.
        other: another record of the rig, which is judged.
        named: one of these has to be named.
        gap: one of these has to be named as well, or the loop to have a free stretch; none where the rig has none.
        first: the first name has to be one of them.
        at_most: left on what is judged, in the unit; nan where `part` says it.
        part: left on what is judged, over what the first model leaves there.
    """

    name: str
    file: str
    unit: str
    named: frozenset[str]
    columns: str | None = None
    units: str | None = None
    hold: "InputHold" = "hold"
    fitted_rows: int | None = None
    other: str | None = None
    first: bool = False
    gap: frozenset[str] = frozenset()
    at_most: float = math.nan
    part: float = math.nan


RIGS: tuple[Rig, ...] = (
    Rig("stack", "piezo_stack_ramps.csv", "µm", frozenset({"rate_independent_hysteresis"}), at_most=0.20),
    Rig(
        "silverbox", "silverbox_multisine.csv", "mV", frozenset({"stiffening"}), "time_s,input_V,output_mV", "s,V,mV",
        "smooth", 20_000, first=True, at_most=0.45,
    ),
    Rig(
        "damper", "friction_damper_05Hz.csv", "kip",
        frozenset({"coulomb_friction", "rate_independent_hysteresis", "hysteretic_spring"}),
        "time_s,displacement_in,force_kip", "s,in,kip", "smooth", other="friction_damper_1Hz.csv",
        gap=frozenset({"backlash", "dead_zone", "output_dead_zone"}), part=0.35,
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a rig, in the unit of its readings.

    Attributes:
        name: of the rig.
        structure: of the first model.
        verdict: the contract's word.
        named: the effects, in the order of adding.
        complete: whether nothing is left above the noise.
        before: what the first model leaves on what is judged (rms about a gain and an offset of its own).
        after: what the corrected model leaves there, driven freely.
        bound: what that is held to.
        met: whether it is, and the names are right.
        seconds: of wall time, first model and diagnosis.
        reported: rms on the rows of the fitted record that no choice saw.
        unit: of the readings.
        free_stretch: of the input after each reversal, in its unit; None where the loop has none.
    """

    name: str
    structure: str
    verdict: str
    named: tuple[str, ...]
    complete: bool
    before: float
    after: float
    bound: float
    met: bool
    seconds: float
    reported: float
    unit: str = field(default="µm")
    free_stretch: float | None = None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare which rigs are diagnosed, where their records are, and where the results go."""
    names = ", ".join(x.name for x in RIGS)
    parser.add_argument("--rigs", nargs="+", metavar="NAME", help=f"default: all of {names}")
    parser.add_argument("--data", type=Path, metavar="DIR", help=f"default: {DATA} beside the checkout")
    parser.add_argument("--out", type=Path, metavar="DIR", default=Path("results/benchmark-rigs"))


def run(arguments: argparse.Namespace) -> int:
    """Print the table, write rigs.json and the diagnosis of every rig.

    Raises:
        InputError: a rig is none of these, or its record is not there.
        RunError: a model or a diagnosis failed.
    """
    import json

    from bender_loop.shell.files import prepare_directory, write_atomically
    from bender_loop.shell.progress import Progress, print_table

    rigs = wanted("--rigs", arguments.rigs, {x.name: x for x in RIGS})
    data = data_folder(arguments.data)
    refuse_missing(missing_of((x.file for x in rigs), data), data, "the rigs")
    out = prepare_directory(arguments.out)
    found: list[Outcome] = []
    with Progress("rigs") as bar:
        for k, rig in enumerate(rigs):
            bar.update(k, len(rigs), rig.name)
            found.append(outcome_of(rig, data, prepare_directory(out / rig.name)))
    rows = [
        [x.name, _named(x), "yes" if x.complete else "no", f"{x.before:.3g} {x.unit}",
         f"{x.after:.3g} {x.unit}", f"{x.bound:.3g} {x.unit}", "yes" if x.met else "no", f"{x.seconds:.0f}"]
        for x in found
    ]  # fmt: skip
    print_table("other people's rigs: rms on held-out rows", COLUMNS, rows)
    write_atomically(out / "rigs.json", json.dumps([asdict(x) for x in found], indent=2) + "\n")
    sys.stdout.write(f"written: {out / 'rigs.json'}\n")
    return 0


def _named(outcome: Outcome) -> str:
    told = " + ".join(outcome.named) or outcome.verdict
    return told if outcome.free_stretch is None else f"{told}, free for {outcome.free_stretch:.3g}"


def outcome_of(rig: Rig, data: Path, out: Path) -> Outcome:
    """Return what comes of one rig, from its record alone: a first model, its diagnosis, and the residual."""
    import time

    from bender_discrepancy.settings import Settings
    from bender_discrepancy.workflow import diagnose
    from bender_identify.first_model.choice import first_model
    from bender_identify.records.experiment import experiment_of
    from bender_identify.settings import Settings as IdentifySettings
    from bender_loop.records.record import read_record

    whole = read_record(data / rig.file, rig.columns, rig.units)
    fitted = _rows(whole, slice(0, rig.fitted_rows))
    begin = time.perf_counter()
    first = first_model([experiment_of(fitted, rig.file, IdentifySettings(), rig.hold)]).chosen
    model = first.structure.model(first.values, first.gain, first.offsets[0], rig.name)
    settings = Settings(rig.hold != "hold", smooth=rig.hold == "smooth")
    diagnosis = diagnose(model, [fitted], settings, None, [rig.file])
    seconds = time.perf_counter() - begin
    diagnosis.write(out)
    before, after = _left(rig, data, whole, diagnosis)
    named = tuple(x.id for x in diagnosis.added) if diagnosis.verdict == "named" else ()
    bound = rig.at_most if math.isfinite(rig.at_most) else rig.part * before
    right = bool(named) and (named[0] in rig.named if rig.first else bool(rig.named & set(named)))
    free = _free_stretch(diagnosis) if named else None
    right = right and (not rig.gap or bool(rig.gap & set(named)) or free is not None)
    reported = diagnosis.to_dict()["gap"]["after"]["rms_um"]
    complete = bool(diagnosis.to_dict()["complete"])
    met = right and after <= bound
    told = (diagnosis.verdict, named, complete, before, after, bound, met, seconds, reported, rig.unit)
    return Outcome(rig.name, first.structure.name, *told, free)


def _free_stretch(diagnosis: "Diagnosis") -> float | None:
    """Return over how much of the input the reading stands still after each reversal, None where it does not."""
    from bender_discrepancy.report.effect_sections import driven_V
    from bender_discrepancy.report.loop_figures import loop_of

    findings = diagnosis.findings
    if not any(x.id == "rate_independent_hysteresis" for x in findings.model.blocks):
        return None
    free = loop_of(findings.model, *driven_V(findings)).free
    return None if free is None else free.length_V


def _left(rig: Rig, data: Path, whole: "Record", diagnosis: "Diagnosis") -> tuple[float, float]:
    """Return what the first and the corrected model leave where no fit was: gap as given and corrected, rms."""
    from bender_loop.records.record import read_record

    gap = diagnosis.to_dict()["gap"]
    if rig.other is None and rig.fitted_rows is None:
        return gap["recalibrated"]["rms_um"], gap["after"]["rms_um"]
    if rig.other is not None:
        judged = read_record(data / rig.other, rig.columns, rig.units)
        return _free_run(judged, rig, diagnosis, 0)
    assert rig.fitted_rows is not None
    return _free_run(whole, rig, diagnosis, rig.fitted_rows)


def _free_run(record: "Record", rig: Rig, diagnosis: "Diagnosis", since: int) -> tuple[float, float]:
    """Return rms from a row on of a record that the models follow from its first row, each about its own offset."""
    import numpy as np

    from bender_compiled.simulation import Simulator
    from bender_discrepancy.records.initial_motion import in_motion_from
    from bender_discrepancy.records.observations import observe

    seen = observe(record, rig.hold != "hold", smooth=rig.hold == "smooth")
    in_motion = {"motion", "from_voltage"} & set(diagnosis.to_dict()["start"])
    drive = in_motion_from(seen, diagnosis.findings.model).drive if in_motion else seen.drive
    found = []
    for model in (diagnosis.findings.search.base, diagnosis.findings.model):
        left = (record.displacement_um - Simulator(drive).run(model).reading_um)[since:]
        found.append(float(np.nanstd(left)))
    return found[0], found[1]


def _rows(record: "Record", rows: slice) -> "Record":
    from dataclasses import replace

    columns = {name: values[rows] for name, values in record.columns().items()}
    return replace(record, **columns)  # pyright: ignore[reportArgumentType]
