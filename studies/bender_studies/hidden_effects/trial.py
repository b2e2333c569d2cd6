"""One trial: records are diagnosed in a process that knows nothing of what is hidden; what it answers comes back."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from bender_discrepancy.diagnosis import Diagnosis
    from bender_loop.records.record import Record

MODEL = "paper"
FMU = "model.fmu"
# of the readings of a second record, those nearest to the simulation: frames may be wrong
CENTRAL = 0.98


@dataclass(frozen=True, slots=True)
class Trial:
    """What is given to the process that is judged.

    Attributes:
        id: says nothing about what is hidden.
        records: files to diagnose, of one bench.
        second: another record of the bench, which no fit sees; None where there is none.
        directory: where the corrected FMU and the profile of the next experiment go.
        fmu: the nominal model as an FMU of anybody's; None for the model itself.
        model: a file of a model whose own numbers are a little wrong; None for the nominal one.
    """

    id: str
    records: tuple[Path, ...]
    second: Path | None
    directory: Path
    fmu: Path | None = None
    model: Path | None = None


@dataclass(frozen=True, slots=True)
class Answer:
    """What came back.

    Attributes:
        id: of the trial.
        verdict: the contract's word, "error" where it failed.
        named: effects in the corrected model, in the order of adding.
        rivals: effects that could stand in the place of one of them.
        certain: those of the named ones that nothing else may stand for.
        probabilities: of the effects in the corrected model, as the answer has them.
        cases: what each of these was made from.
        parameters: "effect.parameter" -> value, of the effects in the corrected model.
        gap: of `diagnosis.json`.
        second: rms on the second record, in um: recalibrated on the first one, and of the corrected FMU.
        profile: file of the next experiment, None where none is proposed.
        columns: that a further record should have, as the answer says.
        seconds: of wall time for the diagnosis.
        error: what went wrong, "" where nothing did.
    """

    id: str
    verdict: str
    named: tuple[str, ...] = ()
    rivals: tuple[str, ...] = ()
    certain: tuple[str, ...] = ()
    probabilities: dict[str, float] = field(default_factory=dict)
    cases: dict[str, tuple[float, ...]] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    gap: dict[str, Any] = field(default_factory=dict)
    second: dict[str, float] = field(default_factory=dict)
    profile: Path | None = None
    columns: tuple[str, ...] = ()
    seconds: float = 0.0
    error: str = ""


def answer(trial: Trial) -> Answer:
    """Diagnose the records of a trial; what goes wrong is an answer too."""
    begin = time.perf_counter()
    try:
        return _answer(trial, begin)
    except Exception as error:
        return Answer(trial.id, "error", seconds=time.perf_counter() - begin, error=f"{type(error).__name__}: {error}")


def _answer(trial: Trial, begin: float) -> Answer:
    from bender_discrepancy.workflow import diagnose
    from bender_inference.records.checks import read_model, read_records

    trial.directory.mkdir(parents=True, exist_ok=True)
    records = read_records(trial.records)
    given = str(trial.model or MODEL)
    diagnosis = diagnose(read_model(given), records) if trial.fmu is None else _of_fmu(trial.fmu, records)
    diagnosis.write(trial.directory, report=False)
    seconds = time.perf_counter() - begin
    added = tuple(x.id for x in diagnosis.added)
    told = diagnosis.to_dict()
    second = _on_second(trial, diagnosis) if trial.second is not None and trial.fmu is None else {}
    return Answer(
        id=trial.id,
        verdict=diagnosis.verdict,
        named=added,
        rivals=tuple(x.id for x in diagnosis.effects if x.id not in added),
        certain=tuple(x.id for x in diagnosis.findings.certain),
        probabilities={x.id: x.probability for x in diagnosis.findings.search.grades.effects},
        cases={x.id: x.case.parts for x in diagnosis.findings.search.grades.effects},
        parameters={f"{x.id}.{number.name}": number.value for x in diagnosis.added for number in x.numbers},
        gap=told["gap"],
        second=second,
        profile=_profile(diagnosis, trial.directory),
        columns=tuple(x["column"] for x in told["columns_that_would_tell"]),
        seconds=seconds,
    )


def _profile(diagnosis: "Diagnosis", folder: Path) -> Path | None:
    """Return the file of the next experiment: here one is played too that promises little."""
    from bender_inference.experiment.proposal import PROFILE

    if diagnosis.next_experiment is None:
        return None
    (folder / PROFILE).write_text(diagnosis.next_experiment.to_csv(), encoding="utf-8")
    return folder / PROFILE


def _of_fmu(fmu: Path, records: "Sequence[Record]") -> "Diagnosis":
    from bender_discrepancy.foreign.diagnose import diagnose_fmu

    return diagnose_fmu(fmu, "voltage", "displacement", records)


def _on_second(trial: Trial, diagnosis: "Diagnosis") -> dict[str, float]:
    """Drive the corrected FMU, and the recalibrated model, with the second record; the offset of it is free.

    A model that runs away under voltages which the first record did not have leaves infinitely much there.
    """
    from bender_compiled.simulation import Simulator
    from bender_discrepancy.conclusion.measurement.corrected_model import driven
    from bender_discrepancy.conclusion.measurement.playable import playable
    from bender_inference.records.observations import observe
    from bender_loop.errors import RunError
    from bender_loop.records.record import read_record

    assert trial.second is not None
    record = read_record(trial.second)
    seen = observe(record)
    gain = diagnosis.findings.search.found.base.calibration.gain
    before = gain * Simulator(seen.drive).run(diagnosis.findings.search.base).reading_um
    if not (trial.directory / FMU).exists():
        return {"before_um": _left_um(record, before), "after_um": _left_um(record, before)}
    played, read = playable(seen.drive)
    try:
        (after,) = driven(trial.directory / FMU, [played])
    except RunError:
        return {"before_um": _left_um(record, before), "after_um": math.inf}
    return {"before_um": _left_um(record, before), "after_um": _left_um(record, read.readings(after))}


def _left_um(record: "Record", simulated: "np.ndarray") -> float:
    """Return the rms of measured minus simulated about its median, over its central part."""
    import numpy as np

    left = record.displacement_um - simulated
    left = left[np.isfinite(left)]
    left = np.sort(np.abs(left - np.median(left)))[: max(1, math.ceil(CENTRAL * left.size))]
    return float(np.sqrt(np.mean(left**2)))
