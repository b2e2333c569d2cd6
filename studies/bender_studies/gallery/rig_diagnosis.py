"""What the workflow says of a rig, and whether that is what the rig has."""

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bender_loop.shell.files import prepare_directory, write_atomically

if TYPE_CHECKING:
    from bender_discrepancy.diagnosis import Diagnosis
    from bender_proving.gallery import PublishedRig, RigRecord

RECORD, MODEL = "record.csv", "nominal.toml"


@dataclass(frozen=True, slots=True)
class RigDiagnosis:
    """One rig of the gallery.

    Attributes:
        rig: its name.
        missing: what its model lacks, in words.
        verdict: the contract's word.
        sentence: the report's first.
        added: effects that are put into the model.
        listed: all effects that are listed, rivals among them.
        complete: whether nothing is left above the noise.
        before, after: residual on held-out readings of the recalibrated and of the corrected model, rms.
        noise: floor of the readings.
        unit: of these three.
        is_right: whether what it says is what the rig has; of a rig for which the catalogue has no word, whether it
            says that it does not know all of it.
    """

    rig: str
    missing: str
    verdict: str
    sentence: str
    added: tuple[str, ...]
    listed: tuple[str, ...]
    complete: bool
    before: float
    after: float
    noise: float
    unit: str
    is_right: bool


def heads(rig: "PublishedRig") -> list[str]:
    """Return the heads of the columns of a record."""
    return ["time [s]", *(f"{name} [{unit}]" for name, unit in (rig.drive, rig.reading))]


def record_text(rig: "PublishedRig", record: "RigRecord") -> str:
    """Return a record as its owner would have it: columns by their own names, with their units."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(heads(rig))
    rows.writerows(zip(*(x.tolist() for x in (record.time_s, record.drive, record.reading)), strict=True))
    return text.getvalue()


def diagnose_rig(rig: "PublishedRig", seed: int, out: Path) -> RigDiagnosis:
    """Play a rig, write its record and its model, diagnose these, and write the report beside them."""
    import numpy as np
    import tomli_w

    from bender_discrepancy.workflow import diagnose
    from bender_loop.records.record import read_record
    from bender_studies.gallery.nominal import nominal

    folder = prepare_directory(out / rig.name)
    write_atomically(folder / RECORD, record_text(rig, rig.play(np.random.default_rng(seed))))
    record = read_record(folder / RECORD, ",".join(heads(rig)))
    model = nominal(rig, record.quantities[:2])
    write_atomically(folder / MODEL, tomli_w.dumps(model.to_table()))
    diagnosis = diagnose(model, [record], names=[RECORD])
    diagnosis.write(folder)
    return outcome_of_diagnosis(rig, diagnosis)


def outcome_of_diagnosis(rig: "PublishedRig", diagnosis: "Diagnosis") -> RigDiagnosis:
    """Return what a diagnosis says of a rig."""
    told = diagnosis.to_dict()
    added, listed = tuple(x.id for x in diagnosis.added), tuple(x.id for x in diagnosis.effects)
    gap, complete = told["gap"], bool(told["complete"])
    figures = (gap["recalibrated"]["rms"], gap["after"]["rms"], gap["noise_floor"])
    words = (rig.name, rig.missing, diagnosis.verdict, told["sentence"].replace(" um", " µm"))
    right = is_right(rig.names, diagnosis.verdict, added, listed, complete)
    return RigDiagnosis(*words, added, listed, complete, *figures, told["unit"], right)


def is_right(
    names: frozenset[str], verdict: str, added: tuple[str, ...], listed: tuple[str, ...], complete: bool
) -> bool:
    """Return whether a verdict is that of a rig whose effect has these names in the catalogue, or none."""
    if not names:
        return not complete and verdict in ("named", "unexplained")
    if verdict == "ambiguous":
        return bool(names & set(listed))
    return verdict == "named" and set(added) <= names
