"""One trial: records are diagnosed in a process that knows nothing of what is hidden; what it answers comes back."""

import math
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

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
    """

    id: str
    records: tuple[Path, ...]
    second: Path | None
    directory: Path


@dataclass(frozen=True, slots=True)
class Answer:
    """What came back.

    Attributes:
        id: of the trial.
        verdict: the contract's word, "error" where it failed.
        named: effects in the corrected model, in the order of adding.
        rivals: effects that could stand in the place of the last one.
        parameters: "effect.parameter" -> value, of the effects in the corrected model.
        gap: of `diagnosis.json`.
        second: rms on the second record, in um: recalibrated on the first one, and of the corrected FMU.
        profile: file of the next experiment, None where none is proposed.
        seconds: of wall time for the diagnosis.
        error: what went wrong, "" where nothing did.
    """

    id: str
    verdict: str
    named: tuple[str, ...] = ()
    rivals: tuple[str, ...] = ()
    parameters: dict[str, float] = field(default_factory=dict)
    gap: dict[str, Any] = field(default_factory=dict)
    second: dict[str, float] = field(default_factory=dict)
    profile: Path | None = None
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
    from bender_discrepancy.command import next_experiment
    from bender_discrepancy.conclusion.diagnosis_json import outcome
    from bender_discrepancy.conclusion.findings import find
    from bender_discrepancy.conclusion.gap import measure
    from bender_discrepancy.records.checks import read_model, read_records
    from bender_discrepancy.workflow import diagnose

    trial.directory.mkdir(parents=True, exist_ok=True)
    diagnosis = diagnose(read_model(MODEL), read_records(trial.records))
    findings = find(diagnosis)
    measured = measure(diagnosis, findings.model, findings.calibration, trial.directory / FMU, findings.of_record)
    proposed = next_experiment(findings, trial.directory)
    told = outcome(findings, measured, next_experiment=proposed)
    seconds = time.perf_counter() - begin
    added = {x.id for x in findings.added}
    effects = [x for x in told["effects"] if "rival_of" not in x]
    numbers = {f"{x['id']}.{name}": p["value"] for x in effects for name, p in x["parameters"].items()}
    second = _on_second(trial, findings) if trial.second is not None else {}
    return Answer(
        id=trial.id,
        verdict=told["verdict"],
        named=tuple(x["id"] for x in effects),
        rivals=tuple(x["id"] for x in told["effects"] if x["id"] not in added),
        parameters={k: v for k, v in numbers.items() if isinstance(v, int | float)},
        gap=told["gap"],
        second=second,
        profile=trial.directory / proposed["profile"] if proposed else None,
        seconds=seconds,
    )


def _on_second(trial: Trial, findings: Any) -> dict[str, float]:
    """Drive the corrected FMU, and the recalibrated model, with the second record; the offset of it is free."""
    from bender_compiled.simulation import Simulator
    from bender_discrepancy.conclusion.corrected_model import driven
    from bender_discrepancy.conclusion.playable import playable
    from bender_discrepancy.records.observations import observe
    from bender_loop.records.record import read_record

    assert trial.second is not None
    record = read_record(trial.second)
    seen = observe(record)
    gain = findings.diagnosis.found.base.calibration.gain
    before = gain * Simulator(seen.drive).run(findings.diagnosis.base).reading_um
    played, rows = playable(seen.drive)
    (after,) = driven(trial.directory / FMU, [played])
    return {"before_um": _left_um(record, before), "after_um": _left_um(record, after[rows])}


def _left_um(record: "Record", simulated: "np.ndarray") -> float:
    """Return the rms of measured minus simulated about its median, over its central part."""
    import numpy as np

    left = record.displacement_um - simulated
    left = left[np.isfinite(left)]
    left = np.sort(np.abs(left - np.median(left)))[: max(1, math.ceil(CENTRAL * left.size))]
    return float(np.sqrt(np.mean(left**2)))


def silence() -> None:
    """Keep the libraries of a worker to one thread: the workers share the processors."""
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
