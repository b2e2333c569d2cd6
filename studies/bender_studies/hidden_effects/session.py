"""A run of the judge: cases are drawn, diagnosed in worker processes, and judged as the answers come."""

import math
import os
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from bender_studies.hidden_effects.judging import (
    APPROXIMATE,
    BY_NUMBERS,
    HIDDEN,
    LAGGING,
    Judged,
    as_known,
    central_share,
    numbers_right,
)
from bender_studies.hidden_effects.trial import CENTRAL, FMU, MODEL, Answer, Trial, answer
from bender_studies.runner import workers

if TYPE_CHECKING:
    import numpy as np

    from bender_loop.fmu.plant import FmuPlant
    from bender_loop.records.record import Record
    from bender_proving import Case

# further records that an answer asks for are numbered from here, apart from the bench's own
EXPERIMENT = 10
SECOND = 1


@dataclass(frozen=True, slots=True)
class Nominal:
    """The nominal model as an FMU, and whether it is linear; the benches then are, too."""

    fmu: Path
    linear: bool


@dataclass(slots=True)
class _Running:
    case: "Case"
    trial: Trial
    duration_s: float
    first: Answer | None = None


def judge_cases(
    drawn: Iterable["Case"],
    directory: Path,
    jobs: int | None,
    nominal: Nominal | None = None,
) -> Iterator[Judged]:
    """Diagnose every case and yield the judgements as they come.

    Args:
        drawn: the cases, drawn one at a time.
        directory: gets a folder for each case.
        jobs: processes that diagnose.
        nominal: the model of the diagnosis, and whether the benches are linear; None for the paper's model.
    """
    waiting = iter(drawn)
    jobs = jobs or os.cpu_count() or 1
    with workers(jobs) as pool:
        running: dict[Future[Answer], _Running] = {}
        while True:
            while len(running) < jobs + 1 and (case := next(waiting, None)) is not None:
                item = _written(case, directory, nominal)
                running[pool.submit(answer, item.trial)] = item
            if not running:
                return
            ready, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in ready:
                item = running.pop(future)
                again = _again(item, future.result(), directory)
                if again is not None:
                    running[pool.submit(answer, again)] = item
                    continue
                yield _judged(item, future.result())


def _written(case: "Case", directory: Path, nominal: Nominal | None) -> _Running:
    from bender_loop.records.record import write_record
    from bender_proving import Bench

    folder = directory / case.id
    folder.mkdir(parents=True, exist_ok=True)
    bench = Bench(case, linear=nominal is not None and nominal.linear)
    record = bench.record(bench.excitation(), bench.noise())
    write_record(folder / "record.csv", record)
    second = None
    if case.kind == "single":
        second = folder / "second.csv"
        write_record(second, bench.record(bench.excitation(SECOND), bench.noise(SECOND), SECOND))
    fmu, model = nominal.fmu if nominal else None, _given(case, folder)
    trial = Trial(case.id, (folder / "record.csv",), second, folder / "answer", fmu, model)
    return _Running(case, trial, float(record.time_s[-1] - record.time_s[0]))


def _given(case: "Case", folder: Path) -> Path | None:
    """Write the model that is given where its own numbers are not those of the bench."""
    import tomli_w

    from bender_plant.model import load_model

    if case.given == type(case.given)():
        return None
    nominal = load_model(MODEL)
    modes = next(x.parameters for x in nominal.blocks if x.id == "bending_modes")
    own = {"frequency_factor": case.given.frequency, "damping_ratio": case.given.damping * modes.damping_ratio}
    model = nominal.with_block("bending_modes", **(asdict(modes) | own)).with_block("calibration", gain=case.given.gain)
    if case.given.lag_s > 0.0:
        model = model.with_block("sensor_lag", time_constant_s=case.given.lag * case.given.lag_s)
    path = folder / "model.toml"
    path.write_text(tomli_w.dumps(model.to_table()), encoding="utf-8")
    return path


def _again(item: _Running, found: Answer, directory: Path) -> Trial | None:
    """Record on the hidden bench what an open answer asks for; returns the trial with that record beside the first.

    The designed experiment is played, or else the first excitation again, and read with the columns that the answer
    would like to see.
    """
    if not _asks(item, found):
        return None
    import numpy as np

    from bender_loop.records.record import write_record
    from bender_proving import Bench
    from bender_proving.records.excitation import played

    item.first = found
    bench = Bench(item.case)
    if found.profile is None:
        plan = bench.excitation()
    else:
        plan = played(item.case.sensor, *np.loadtxt(found.profile, delimiter=",", skiprows=1, unpack=True))
    record = bench.record(plan, bench.noise(EXPERIMENT), EXPERIMENT)
    path = directory / item.case.id / "experiment.csv"
    write_record(path, bench.with_columns(record, plan, found.columns, EXPERIMENT))
    return replace(item.trial, records=(*item.trial.records, path), second=None, directory=path.parent / "after")


def _asks(item: _Running, found: Answer) -> bool:
    """Whether an answer leaves open what is missing, and says what would tell; FMUs of anybody's are asked once."""
    if item.first is not None or item.trial.fmu is not None or item.case.kind not in ("weak", *HIDDEN):
        return False
    if item.case.kind != "weak" and found.verdict not in ("ambiguous", "likely"):
        return False
    return found.profile is not None or bool(found.columns)


def _judged(item: _Running, last: Answer) -> Judged:
    from bender_proving import NOISE_UM
    from bender_proving.cases.lookalikes import lookalike

    case, first = item.case, item.first or last
    if item.trial.fmu is not None:
        first = as_known(first)
    steps = [abs(x.magnitude) for x in case.effects if x.id == "sensor_quantisation"]
    noise = NOISE_UM[case.sensor] * case.gain
    return Judged(
        kind=case.kind,
        truth=case.effect_ids,
        sensor=case.sensor,
        spoiled=case.outlying > 0.0,
        answer=first,
        after=last if item.first is not None else None,
        floor_um=math.hypot(noise, *(case.gain * x / math.sqrt(12.0) for x in steps)),
        noise_um=noise,
        numbers_right=numbers_right(case, first, item.duration_s),
        left_um=_left_um(item, first) if case.kind == "single" else math.nan,
        moved=case.moved,
        way=_way(case),
        lookalike=lookalike(case) if case.kind == "moved" else "",
    )


def _way(case: "Case") -> str:
    if case.given.lag_s > 0.0:
        return LAGGING
    if case.given != type(case.given)():
        return APPROXIMATE
    return "loop" if case.closed_loop else case.start.replace("rest", "")


def _on_raster(plant: "FmuPlant", record: "Record") -> "np.ndarray":
    """Drive the corrected FMU as it says that it wants to be: in steps of its own default experiment."""
    from bender_inference.records.observations import observe
    from bender_loop.fmu.file import read_description
    from bender_loop.records.raster import drive_raster

    drive = observe(record).drive
    experiment = read_description(plant.path).defaultExperiment
    step_s = float(experiment.stepSize) if experiment and experiment.stepSize else 1e-3
    return drive_raster(plant, drive.row_time_s, drive.command_time_s, drive.voltage_V, drive.linear, step_s)


def _left_um(item: _Running, found: Answer) -> float:
    """Drive the corrected FMU with a record that the diagnosis was not given; nan without an FMU, inf if it fails.

    Two percent of the readings, those furthest off, are left out on both sides of the comparison: a central part of
    normal numbers has a known share of their mean square.
    """
    import numpy as np

    from bender_loop.errors import RunError
    from bender_loop.fmu.plant import FmuPlant
    from bender_loop.records.record import read_record
    from bender_loop.records.replay import replay

    fmu = item.trial.directory / FMU
    repeats = found.named and not set(found.named) & set(BY_NUMBERS) and not set(item.case.effect_ids) & set(BY_NUMBERS)
    path = item.trial.second if repeats and item.trial.second is not None else item.trial.records[0]
    if not fmu.exists():
        return math.nan
    record = read_record(path)
    with FmuPlant(fmu) as plant:
        try:
            driven = replay(plant, record).simulated_um if item.trial.fmu is None else _on_raster(plant, record)
        except RunError:  # a spring that softens may run away under voltages that its record did not have
            return math.inf
        left = record.displacement_um - driven
    left = left[np.isfinite(left)]
    inner = np.sort(np.abs(left - np.median(left)))[: max(1, math.ceil(CENTRAL * left.size))]
    return math.sqrt(float(np.mean(inner**2)) / central_share(CENTRAL))
