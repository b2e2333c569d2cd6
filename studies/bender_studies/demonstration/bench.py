"""The demonstration on the emulated bench: run, diagnose, tune again on the corrected model, run again.

The bench hides an effect that the nominal model lacks; it stands in the bench file that the demonstration writes, and
nothing but the emulator reads that file. The diagnosis sees the record of the run.
"""

import contextlib
import shutil
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from bender_export.build import ensure_plant_fmu
from bender_loop.control.metrics import step_metrics
from bender_loop.control.pid import Limits
from bender_loop.control.references import Profile
from bender_loop.control.trace import Trace
from bender_loop.errors import RunError
from bender_loop.fmu.diagnosed import diagnosed
from bender_loop.records.record import Array, Record, read_record
from bender_loop.shell.files import prepare_directory, write_atomically
from bender_native.ready import ready_plant_fmu
from bender_plant.model import load_model
from bender_tuner.results.gains_file import read_controller
from bender_tuner.task.session import Session, hold_session
from bender_tuner.task.settings import TuneSettings
from bender_tuner.task.tuning import Ended

NOMINAL = "bench"
HIDDEN_DELAY_S = 0.12
"""What the bench hides: commands that take effect as late as four frames, as a driver with a queue makes them."""

STEPS_S, SETPOINTS_UM, DURATION_S = (0.0, 0.5, 4.5, 7.5), (0.0, 10.0, 4.0, 14.0), 11.0
PATIENT = {"heartbeat_s": 0.5, "frame_age_s": 0.5}
"""A demonstration may run on a busy machine, and nothing real is at stake."""
SLEW_SHARE = 0.9
"""The controller keeps to this share of the guard's bound of the slew."""
BEFORE, AFTER, DIAGNOSIS, RETUNED = "run-1", "run-2", "diagnosis", "retuned"


@dataclass(frozen=True, slots=True, eq=False)
class BenchStory:
    """What came of it.

    Attributes:
        before: the run with the gains from the nominal model.
        diagnosis: content of `diagnosis.json`.
        session: tuning on the corrected FMU.
        after: the run with those gains.
    """

    before: Record
    diagnosis: dict[str, Any]
    session: Session
    after: Record


def write_bench(out: Path) -> Path:
    """Write the bench file, the model that the emulator runs and the setpoints; returns the bench file."""
    hidden = load_model(NOMINAL).with_block("transport_delay", delay_s=HIDDEN_DELAY_S)
    write_atomically(prepare_directory(out) / "hidden.toml", tomli_w.dumps(replace(hidden, name="hidden").to_table()))
    write_atomically(out / "bench.toml", tomli_w.dumps({"emulator": {"model": "hidden.toml"}, "guard": PATIENT}))
    lines = [f"{time_s!r},{setpoint!r}\n" for time_s, setpoint in zip(STEPS_S, SETPOINTS_UM, strict=True)]
    write_atomically(out / "setpoints.csv", "time_s,setpoint_um\n" + "".join(lines))
    return out / "bench.toml"


def run_on_bench(bench_file: Path, gains_file: Path, out: Path) -> Record:
    """Run the loop on the emulated bench, in real time; returns its record.

    Gains that name a model run the model-following controller, which is not told the set-points beforehand.
    """
    from bender_hil.bench_file import read_bench
    from bender_hil.runner.following_program import following
    from bender_hil.runner.program import ClosedLoop
    from bender_hil.runner.run import run
    from bender_hil.runner.run_lock import sole_run_with_note

    bench = read_bench(bench_file)
    gains, limits, _, model = read_controller(gains_file)
    guard = bench.guard
    bounded = Limits(max(guard.minimum_V, limits.lower_V), min(guard.maximum_V, limits.upper_V), limits.tracking_time_s)
    program = ClosedLoop(Profile(STEPS_S, SETPOINTS_UM), gains, bounded, SLEW_SHARE * guard.slew_V_per_s, DURATION_S)
    rate_Hz = bench.rate_Hz
    chosen = (
        contextlib.nullcontext(program)
        if model is None
        else following(program, model, gains_file.parent / model.fmu, rate_Hz, preview=False)
    )
    with sole_run_with_note(None, out, _tell), chosen as running:
        result = run(bench, running, out, fmu=lambda name: ensure_plant_fmu(name))
    if result.interrupted:
        raise KeyboardInterrupt
    if result.record is None or result.ended.code is not None:
        raise RunError(f"the run on the emulated bench was ended: {result.ended.sentence}")
    return read_record(result.record)


def _tell(sentence: str) -> None:
    sys.stderr.write(f"bender: {sentence}\n")


def diagnose_run(record: Path, out: Path, given: str = NOMINAL) -> dict[str, Any]:
    """`bender diagnose RECORD --model bench`, or another model, into `out`; returns `diagnosis.json`."""
    from bender_discrepancy.command import diagnose_into
    from bender_discrepancy.output_folder import all_or_no_files
    from bender_discrepancy.report.chart_process import ChartProcess
    from bender_inference.records.checks import read_model, read_records
    from bender_inference.settings import Settings

    with all_or_no_files(out) as stage, ChartProcess() as chart_process:
        chart_process.begin()
        model, records = read_model(given), read_records([record])
        return diagnose_into(stage, model, records, Settings(), [str(record)], chart_process).to_dict()


def retune(model: Path, settings: TuneSettings, out: Path) -> Session:
    """Tune on the corrected model and its rivals as on the nominal one, and a controller that follows it."""
    found = diagnosed(model).with_fmus_of(ready_plant_fmu)
    session = hold_session(ready_plant_fmu(model), None, None, settings, out, follow_model=True, found=found)
    if session.ended is Ended.INTERRUPTED:
        raise KeyboardInterrupt
    if session.ended is not Ended.COMPLETE:
        raise RunError(session.reason)
    return session


def on_the_bench(session: Session, out: Path) -> BenchStory:
    """The whole way, into `out`; `session` is the tuning on the nominal model."""
    for name in (BEFORE, AFTER):
        # a run never writes over another one; those of an earlier demonstration are this one's to remove
        shutil.rmtree(out / name, ignore_errors=True)
    bench = write_bench(out)
    before = run_on_bench(bench, out / "tune" / "gains.toml", out / BEFORE)
    diagnosis = diagnose_run(out / BEFORE / "record.csv", out / DIAGNOSIS)
    again = retune(out / DIAGNOSIS / diagnosis["model"], replace(session.settings, monte_carlo=0), out / RETUNED)
    after = run_on_bench(bench, out / RETUNED / "gains.toml", out / AFTER)
    return BenchStory(before, diagnosis, again, after)


@dataclass(frozen=True, slots=True)
class StepFigures:
    """Figures of one step of a run, from what the camera saw.

    Attributes:
        from_um: set-point before the step.
        to_um: set-point of the step.
        seen_s: how long it was seen, up to the next step or the end of the run.
        overshoot_percent: largest excursion beyond the set-point, of the step.
        settling_time_s: the first frame from which on the error stays within 2 % of the step; NaN for not while seen.
        rms_um: from the set-point, the way there included.
    """

    from_um: float
    to_um: float
    seen_s: float
    overshoot_percent: float
    settling_time_s: float
    rms_um: float


def step_figures(record: Record) -> list[StepFigures]:
    """Return the figures of every step of a run, in their order."""
    found = []
    for k, (begin_s, end_s) in enumerate(zip(STEPS_S[1:], (*STEPS_S[2:], DURATION_S), strict=True), start=1):
        last = end_s == DURATION_S
        rows = np.flatnonzero((record.time_s >= begin_s) & (last | (record.time_s < end_s)))
        rows = rows[np.isfinite(record.displacement_um[rows])]
        time_s, tip_um = record.time_s[rows] - begin_s, record.displacement_um[rows]
        metrics = step_metrics(
            Trace(time_s, np.full(rows.size, SETPOINTS_UM[k]), tip_um, tip_um, record.voltage_V[rows])
        )
        found.append(
            StepFigures(
                from_um=SETPOINTS_UM[k - 1],
                to_um=SETPOINTS_UM[k],
                seen_s=end_s - begin_s,
                overshoot_percent=metrics.overshoot_percent,
                settling_time_s=metrics.settling_time_s,
                rms_um=_rms(tip_um - SETPOINTS_UM[k]),
            )
        )
    return found


def whole_rms_um(record: Record) -> float:
    """Return the rms from the set-point over all frames of a run, the rest before the first step included."""
    error = record.displacement_um - setpoint_at(record.time_s)
    return _rms(error[np.isfinite(error)])


def dead_time_rms_um(record: Record, dead_time_s: float) -> float:
    """Return the rms of a tip that does what is asked, exactly, as soon as the dead time lets a command act.

    Commands are given at frames: a set-point that jumps between two of them is answered by the next. They act when the
    record says that they do.
    """
    given_s = record.time_s if record.command_time_s is None else record.command_time_s
    ticks = np.searchsorted(given_s, record.time_s - dead_time_s + 1e-9, side="right") - 1
    answered = np.where(ticks < 0, SETPOINTS_UM[0], setpoint_at(record.time_s[np.maximum(ticks, 0)]))
    error = answered - setpoint_at(record.time_s)
    return _rms(error[np.isfinite(record.displacement_um)])


def dead_time_s(diagnosis: dict[str, Any]) -> float:
    """Return the dead time that a diagnosis named, 0 for none."""
    found = [x["parameters"] for x in diagnosis["effects"] if x["id"] == "transport_delay"]
    return float(next(iter(found[0].values()))["value"]) if found else 0.0


def _rms(error_um: Array) -> float:
    return float(np.sqrt(np.mean(error_um**2)))


def setpoint_at(time_s: Array) -> Array:
    """The setpoints of the runs."""
    return np.asarray(SETPOINTS_UM)[np.searchsorted(STEPS_S, time_s, side="right") - 1]
