"""One run on a bench, from the bench file to the record. Emulated or not, this is the code that drives it."""

import contextlib
import gc
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from bender_hil.bench_file import BenchFile
from bender_hil.emulated import EmulatedBench
from bender_hil.guard.guard import FAULT
from bender_hil.guard.rules import Trip
from bender_hil.guard.settings import GuardOrders
from bender_hil.guard.spares import Ended
from bender_hil.guard.start import GuardProcess, OutputUnknownError
from bender_hil.log.journal import Journal, JournalError
from bender_hil.log.read_run import GUARD, RUN, RunLog, malformed_is_bad_input, read_run
from bender_hil.log.results import RECORD
from bender_hil.log.summary import Summary, late_ticks, summarise
from bender_hil.log.to_record import to_record
from bender_hil.realtime import priority
from bender_hil.runner import steadiness
from bender_hil.runner.buffered import Buffered, BufferedLoop, can_record
from bender_hil.runner.frames import FrameRing
from bender_hil.runner.interrupts import Interrupts
from bender_hil.runner.loop import CONTROLLER_FAILED, ControlLoop, LoopSettings, Witness
from bender_hil.runner.oscillation import OscillationWatch, ranges_of
from bender_hil.runner.picture_checks import FROZEN_READING, AnswerCheck, FrozenCheck, NoiseCheck
from bender_hil.runner.program import KeepsFiles, Program
from bender_hil.runner.run_folder import plain, run_directory, sha256, versions
from bender_hil.runner.tip_camera import CameraEyes, Eyes
from bender_hil.sensors.sensor_eyes import SensorEyes
from bender_hil.sensors.table import conversion
from bender_hil.sources.kinds import SourceSettings, address_of, where_to_mend
from bender_loop.errors import InputError, RunError
from bender_loop.records.record import write_record
from bender_loop.shell.messages import ClosedError

EMULATED_DELAY_S = 0.002
"""Age of the emulated microscope's picture when it is grabbed: drawing it, and the way through the decoder.
`bender benchmark hil` measures it as photon to frame."""


_WITHOUT_READINGS = ("frame_age", "camera_stalled")
_BY_THE_SENSOR = (*_WITHOUT_READINGS, "lost_tip", "frozen", "noise", "no_tip")
"""Rules that end a run by what its sensor does; which one it is is said with them."""
_WITHOUT_COMMANDS = ("heartbeat", "frame_age")
_STALL_S = 0.5
"""Beyond the age of a frame, for samples that come in blocks."""


class StopWish(Protocol):
    """Who may say STOP."""

    @property
    def token(self) -> str:
        """What the guard has to hear."""
        ...

    def armed(self, port: int | None) -> None:
        """Take where the guard listens; None when it does not any more."""
        ...


@dataclass(frozen=True, slots=True)
class RunResult:
    """How a run ended.

    Attributes:
        directory: with its journals, record and frames.
        ended: how the guard ended it.
        interrupted: somebody asked for the end.
        record: path of the record, None for a run too short for one, or one that could not be written.
        summary: figures of the run.
        log: its journals, read back; empty where they could not be.
        signal: that asked for the end, None where none did.
        unwritten: what could not be written or read back after the output was off, a sentence each.
    """

    directory: Path
    ended: Ended
    interrupted: bool
    record: Path | None
    summary: Summary
    log: RunLog
    signal: str | None = None
    unwritten: tuple[str, ...] = ()


class _Looped(NamedTuple):
    """How the loop ended: why the run failed before it began, and the reason that the controller gave."""

    failure: RunError | None = None
    trip: Trip | None = None


def run(
    bench: BenchFile,
    program: Program,
    out: Path,
    *,
    fmu: Callable[[str], Path] | None = None,
    witness: Witness | None = None,
    started: Callable[[EmulatedBench | None], None] | None = None,
    finished: Callable[[], None] | None = None,
    interrupts: Interrupts | None = None,
    stop: StopWish | None = None,
    tell: Callable[[str], None] | None = None,
) -> RunResult:
    """Run a programme on a bench.

    Args:
        bench: what there is.
        program: what to do.
        out: directory of the run, which must not hold one yet.
        fmu: makes the FMU of a model for the emulated bench; needed when the bench file names no FMU.
        witness: is shown every frame after its command has gone.
        started: is told when the loop begins, with the emulated bench where there is one: for faults by script.
        finished: is told when the output is off, while the emulated bench is still there.
        interrupts: what listens to signals already; made here where it is None.
        stop: who may say STOP to the guard; None for nobody.
        tell: is told, before anything is switched on, which limits follow from the sensor.

    Raises:
        InputError: bad settings, no camera, another instrument, readings too irregular; the output was never on.
        RunError: no supply answers, no tip is found, an emulator does not start, the disk fails; the output is off.
        Interrupted: a signal came before the supply was armed; nothing is written.
        OutputUnknownError: and it could not be confirmed off.
    """
    calibration = bench.calibration_of_readings()
    path = _plant(bench, fmu)
    unwritten: list[str] = []
    with run_directory(out) as folder, contextlib.ExitStack() as ends:
        heard = ends.enter_context(Interrupts()) if interrupts is None else interrupts
        # all that starts from here on inherits it: the camera's threads, the guard, and the emulators, which stand for
        # hardware that would not wait for this machine either
        ends.enter_context(priority(bench.controller.realtime))
        emulated = None
        if bench.emulator is not None and path is not None:
            emulated = ends.enter_context(EmulatedBench(bench.emulator, path, bench.rate_Hz, amplifier=bench.amplifier))
        journal = Journal(out / RUN)
        folder.is_ours = True
        ends.callback(journal.close)
        if isinstance(program, KeepsFiles):
            program.keep(out)
        seen_by, eyes = _open_eyes(bench, emulated, calibration, ends, buffered=isinstance(program, Buffered))
        bench, at_rest = _steadied(bench, program, eyes, tell)
        source = _source(bench, emulated)
        delay_s = _delay_s(bench)
        journal.write(
            "start",
            date=datetime.now().astimezone().isoformat(timespec="seconds"),
            program=program.facts(),
            emulated=emulated is not None,
            delay_s=delay_s,
            exposure_s=None if isinstance(program, Buffered) else bench.exposure_s,
            period_s=1.0 / bench.rate_Hz,
            deadline_s=bench.deadline_s,
            bench=bench.facts(),
            calibration=None if calibration is None else plain(calibration),
            metadata=bench.metadata,
            at_rest=at_rest,
            **seen_by,
            fmu=sha256(path),
            pid=sha256(Path(sys.modules["bender_loop.control.pid"].__file__ or "")),
            versions=versions(),
        )
        # from here on a signal asks for the way down, and nothing else
        heard.defer()
        token = "" if stop is None else stop.token
        orders = GuardOrders(
            source,
            str(out / GUARD),
            bench.guard,
            realtime=bench.controller.realtime,
            stop_token=token,
            amplifier=bench.amplifier,
        )
        with folder.kept_unless_refused():
            guard = GuardProcess(orders)
        ends.callback(guard.close)
        if stop is not None:
            stop.armed(guard.ready.get("stop_port"))
        ring = FrameRing()
        loop = _loop(bench, program, eyes, guard, journal, ring, witness, heard)
        begin = partial(started, emulated) if started is not None else None
        looped = _looped(loop, eyes, guard, journal, bench.zero_readings, begin)
        ended = _explained(guard.wait(), eyes, looped.trip, source)
        if stop is not None and not ended.alarm:
            # over an output that may be on, the button goes on asking, and says what to press when nobody answers
            stop.armed(None)
        if finished is not None:
            finished()
        names: list[str] = []
        if ended.code is not None and heard.signal is None:
            names, complaint = ring.keep(out / "frames", eyes)
            unwritten += [complaint] if complaint else []
        try:
            journal.write(
                "stop",
                status=int(ended.status),
                code=ended.code,
                sentence=ended.sentence,
                alarm=ended.alarm,
                frames=names,
                late_ticks=_late_ticks(out),
            )
            journal.sync()
        except JournalError as error:
            unwritten.append(f"{out / RUN}: its end is missing ({error.strerror})")
    if looped.failure is not None:
        raise _with_alarm(looped.failure, ended)
    return _result(out, ended, heard.signal, emulated is not None, unwritten)


def _steadied(
    bench: BenchFile, program: Program, eyes: Eyes, tell: Callable[[str], None] | None
) -> tuple[BenchFile, dict[str, Any] | None]:
    """Return the bench with the limits that follow from its sensor, and what the log has to say of them.

    A file that sets both limits is taken at its word, and a profile that the source plays rests on no reading.
    """
    if not bench.follows_sensor or isinstance(program, Buffered):
        return bench, None
    with _quiet_memory():
        bench, seen = steadiness.steadied_at_rest(bench, eyes)
    if tell is not None:
        tell(steadiness.limits_sentence(seen, bench.guard))
    return bench, steadiness.facts(seen, bench.guard)


def _loop(
    bench: BenchFile,
    program: Program,
    eyes: CameraEyes | SensorEyes,
    guard: GuardProcess,
    journal: Journal,
    ring: FrameRing,
    witness: Witness | None,
    heard: Interrupts,
) -> ControlLoop | BufferedLoop:
    """Return what carries the programme out: a loop that the sensor clocks, or a look at what the source plays."""
    limits, controller = bench.guard, bench.controller
    if isinstance(program, Buffered) and isinstance(eyes, SensorEyes):
        return BufferedLoop(eyes, guard, program, journal, limits.travel_um, limits.frame_age_s + _STALL_S, heard)
    checks = (
        FrozenCheck(limits.lost_frames) if bench.sensor is None else FrozenCheck(limits.lost_frames, FROZEN_READING),
        AnswerCheck(controller.response_um_per_V, controller.slack_V, lambda: eyes.noise_um),
        OscillationWatch(ranges_of(limits)),
        *([] if bench.sensor is None else [NoiseCheck(ranges_of(limits).travel_um, lambda: eyes.noise_um)]),
    )
    settings = LoopSettings(bench.deadline_s, limits.frame_age_s, _delay_s(bench))
    return ControlLoop(eyes, guard, program, journal, ring, settings, witness, heard, checks)


def _looped(
    loop: ControlLoop | BufferedLoop,
    eyes: Eyes,
    guard: GuardProcess,
    journal: Journal,
    zero_frames: int,
    begin: Callable[[], None] | None,
) -> _Looped:
    """Rest position, then the loop; whatever happens in it, the guard is told to come down."""
    with _quiet_memory():
        try:
            journal.write("ready", **{key: value for key, value in guard.ready.items() if key != "say"})
            zeroed_s = eyes.zero(zero_frames)
            journal.write("rest", noise_um=getattr(eyes, "noise_um", None), readings=zero_frames)
            if begin is not None:
                begin()
            trip = loop.run(zeroed_s).trip
        except RunError as error:
            guard.trip("no_tip", str(error))
            return _Looped(failure=error)
        except JournalError as error:
            guard.trip("journal", f"the run's journal cannot be written ({error.strerror})")
            return _Looped()
        except ClosedError:
            # the guard has gone; waiting for its end finds that out too, and replaces it
            return _Looped()
        except BaseException as error:
            sentence = f"{type(error).__name__}: {error}"
            guard.trip(CONTROLLER_FAILED, sentence)
            ended = guard.wait()
            if ended.alarm or not isinstance(error, KeyboardInterrupt):
                raise _with_alarm(RunError(f"a fault in the controller: {sentence}"), ended) from error
            raise
        guard.stop()
    return _Looped(trip=trip)


def _explained(
    ended: Ended, eyes: CameraEyes | SensorEyes, trip: Trip | None = None, source: SourceSettings | None = None
) -> Ended:
    """An end with what lies behind it: the guard sees only that readings are missing, or that the controller is silent.

    Args:
        ended: as the guard has it.
        eyes: of the run; a sensor says what it raised itself.
        trip: that the loop ended with; None for none.
        source: of the run; that of a package may be what failed.
    """
    if ended.code == FAULT:
        return ended._replace(sentence=f"{ended.sentence}; {where_to_mend(source)}")
    if trip is not None and trip.code == CONTROLLER_FAILED and ended.code in _WITHOUT_COMMANDS:
        return ended._replace(sentence=f"{ended.sentence} ({trip.sentence})")
    if not isinstance(eyes, SensorEyes) or ended.code not in _BY_THE_SENSOR:
        return ended
    why = eyes.trouble() if ended.code in _WITHOUT_READINGS else ""
    return ended._replace(sentence=f"{ended.sentence}; sensor: {eyes.name}{why and ': '}{why}")


def _with_alarm(error: RunError, ended: Ended) -> RunError:
    """What to raise for `error`: an output that is not known to be off comes before everything else."""
    return OutputUnknownError(f"{ended.alarm}; the run failed: {error}") if ended.alarm else error


@contextlib.contextmanager
def _quiet_memory() -> Iterator[None]:
    """No collection and one thread for linear algebra: both cost milliseconds at the wrong moment."""
    from threadpoolctl import threadpool_limits

    was_enabled = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        with threadpool_limits(1):
            yield
    finally:
        gc.unfreeze()
        if was_enabled:
            gc.enable()


def _open_eyes(
    bench: BenchFile,
    emulated: EmulatedBench | None,
    calibration: Any,
    ends: contextlib.ExitStack,
    *,
    buffered: bool,
) -> tuple[dict[str, Any], CameraEyes | SensorEyes]:
    """Open the sensor; returns what the journal has to say of it, and what the loop looks through."""
    if bench.sensor is not None:
        return _open_sensor(bench, emulated, calibration, ends, buffered=buffered)
    if buffered:
        raise InputError(
            '--buffered: a camera does not record by the clock of the source; use a sensor of kind = "daq"'
        )
    from bender_hil.camera.reader import Camera
    from bender_vision.stillness import Stillness
    from bender_vision.tracker import Tracker

    place = emulated.stream if emulated is not None else bench.camera.source
    if place is None:
        raise InputError("camera.source is missing")
    camera = Camera(place, frames_per_s=bench.camera.frames_per_s, settings=bench.camera_settings)
    opened = ends.enter_context(camera).opened
    # a source without noise may well repeat itself
    width_px = bench.vision.wire_um / calibration.um_per_px
    still = None if bench.camera_settings.repeats_count else Stillness(bench.vision, width_px)
    facts = None if opened is None else {"backend": opened.backend, "accepted": dict(opened.accepted)}
    return {"camera": facts}, CameraEyes(camera, Tracker(bench.vision, calibration), still)


def _open_sensor(
    bench: BenchFile,
    emulated: EmulatedBench | None,
    calibration: Any,
    ends: contextlib.ExitStack,
    *,
    buffered: bool,
) -> tuple[dict[str, Any], SensorEyes]:
    table = bench.sensor
    if emulated is not None and bench.emulator is not None and emulated.sensor_resource is not None:
        table = bench.emulator.sensor_table(emulated.sensor_resource)
    if table is None:
        raise InputError("the bench has no sensor")
    sensor = table.instrument.make(table.rate_Hz)
    if buffered and not can_record(sensor):
        raise InputError(f'--buffered: a {table.kind} does not record by the clock of the source; use kind = "daq"')
    to_um = conversion(sensor.unit, calibration)
    name = f"{table.kind} ({address_of(table.instrument)})"
    eyes = SensorEyes(sensor, to_um, table.valid, repeats_count=table.repeats_count, name=name)
    identity = ends.enter_context(eyes).identity
    told = None if identity is None else identity._asdict()
    return {"sensor": {"kind": table.kind, "identity": told, "cannot": list(sensor.cannot)}}, eyes


def _source(bench: BenchFile, emulated: EmulatedBench | None) -> SourceSettings:
    if emulated is not None and bench.emulator is not None:
        return bench.emulator.source(emulated.resource)
    if bench.source is None:
        raise InputError("the bench has no source")
    return bench.source


def _plant(bench: BenchFile, fmu: Callable[[str], Path] | None) -> Path | None:
    if bench.emulator is None:
        return None
    if bench.emulator.fmu is not None:
        path = bench.resolve(bench.emulator.fmu)
        if not path.is_file():
            raise InputError(f"{path}: is not a regular file, expected an FMU (emulator.fmu)")
        return path
    if fmu is None:
        raise InputError("the emulated bench needs an FMU; name one in the bench file with emulator.fmu")
    model = bench.emulator.model
    for path in (bench.resolve(model), Path(model)):
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: is not a regular file, expected a model file (emulator.model)")
    return fmu(str(bench.resolve(model)) if model.endswith(".toml") else model)


def _delay_s(bench: BenchFile) -> float:
    if bench.delay_s is not None:
        return bench.delay_s
    return EMULATED_DELAY_S if bench.emulator is not None else 0.0


def _late_ticks(out: Path) -> list[int] | None:
    """Return which ticks were late, by both journals; None where they cannot be read."""
    try:
        with malformed_is_bad_input(out):
            return list(late_ticks(read_run(out)))
    except InputError:
        return None


def _result(out: Path, ended: Ended, signal: str | None, emulated: bool, unwritten: list[str]) -> RunResult:
    """What can be said of the run; the output is off or the alarm is known, so nothing here may raise bad input."""
    path = None
    log = RunLog(out, {"emulated": emulated}, (), (), ())
    try:
        log = read_run(out)
        record = to_record(log)
        if record is not None:
            write_record(out / RECORD, record)
            path = out / RECORD
    except InputError as error:
        unwritten = [*unwritten, str(error)]
    return RunResult(out, ended, signal is not None, path, summarise(log), log, signal, tuple(unwritten))
