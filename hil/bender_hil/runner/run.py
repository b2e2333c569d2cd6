"""One run on a bench, from the bench file to the record. Emulated or not, this is the code that drives it."""

import contextlib
import gc
import hashlib
import platform
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from bender_hil.bench_file import BenchFile
from bender_hil.emulator.bench import EmulatedBench
from bender_hil.guard.settings import GuardOrders
from bender_hil.guard.start import Ended, GuardProcess, OutputUnknownError
from bender_hil.log.journal import Journal
from bender_hil.log.read_run import GUARD, RUN, read_run
from bender_hil.log.summary import Summary, summarise
from bender_hil.log.to_record import to_record
from bender_hil.realtime import priority
from bender_hil.runner.eyes import CameraEyes, Eyes
from bender_hil.runner.frames import FrameRing
from bender_hil.runner.loop import ControlLoop, LoopSettings, Witness
from bender_hil.runner.place import run_directory
from bender_hil.runner.program import Program
from bender_hil.supply.select import SupplySettings
from bender_hil.wire import ClosedError
from bender_loop.errors import InputError, RunError
from bender_loop.records.record import write_record

EMULATED_DELAY_S = 0.002
"""Age of the emulated microscope's picture when it is grabbed: drawing it, and the way through the decoder.
`bender benchmark hil` measures it as photon to frame."""

_PACKAGES = ("piezo-bender", "opencv-python-headless", "pyvisa", "pyvisa-py", "numpy", "fmpy")
_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")


@dataclass(frozen=True, slots=True)
class RunResult:
    """How a run ended.

    Attributes:
        directory: with its journals, record and frames.
        ended: how the guard ended it.
        interrupted: somebody asked for the end.
        record: path of the record, None for a run too short for one.
        summary: figures of the run.
    """

    directory: Path
    ended: Ended
    interrupted: bool
    record: Path | None
    summary: Summary


def run(
    bench: BenchFile,
    program: Program,
    out: Path,
    *,
    fmu: Callable[[str], Path] | None = None,
    witness: Witness | None = None,
    started: Callable[[EmulatedBench | None], None] | None = None,
    finished: Callable[[], None] | None = None,
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

    Raises:
        InputError: bad settings, no camera, another instrument; the output was never switched on.
        RunError: no supply answers, no tip is found, an emulator does not start; the output is off.
        OutputUnknownError: and it could not be confirmed off.
    """
    calibration = bench.load_calibration()
    path = _plant(bench, fmu)
    with run_directory(out), contextlib.ExitStack() as ends:
        # all that starts from here on inherits it: the camera's threads, the guard, and the emulators, which stand for
        # hardware that would not wait for this machine either
        ends.enter_context(priority(bench.controller.realtime))
        emulated = None
        if bench.emulator is not None and path is not None:
            emulated = ends.enter_context(EmulatedBench(bench.emulator, path, bench.camera.frames_per_s))
        journal = Journal(out / RUN)
        ends.callback(journal.close)
        camera, eyes = _open_eyes(bench, emulated, calibration, ends)
        supply = _supply(bench, emulated)
        delay_s = _delay_s(bench)
        journal.write(
            "start",
            program=program.facts(),
            emulated=emulated is not None,
            delay_s=delay_s,
            period_s=1.0 / bench.camera.frames_per_s,
            bench=bench.facts(),
            calibration=_plain(calibration),
            camera={"backend": camera.backend, "accepted": dict(camera.accepted)} if camera is not None else None,
            fmu=_hash(path),
            pid=_hash(Path(sys.modules["bender_loop.control.pid"].__file__ or "")),
            versions=_versions(),
        )
        guard = GuardProcess(GuardOrders(supply, str(out / GUARD), bench.guard, realtime=bench.controller.realtime))
        ends.callback(guard.close)
        journal.write("ready", **{key: value for key, value in guard.ready.items() if key != "say"})
        loop_settings = LoopSettings(1.0 / bench.camera.frames_per_s, bench.guard.frame_age_s, delay_s)
        ring = FrameRing()
        loop = ControlLoop(eyes, guard, program, journal, ring, loop_settings, witness)
        with _signals(loop):
            begin = partial(started, emulated) if started is not None else None
            failure = _looped(loop, eyes, guard, bench.camera.zero_frames, begin)
            ended = guard.wait()
        if finished is not None:
            finished()
        interrupted = loop.signal is not None
        frames = ring.keep(out / "frames", eyes) if ended.code is not None and not interrupted else []
        journal.write("stop", status=int(ended.status), code=ended.code, alarm=ended.alarm, frames=frames)
        journal.sync()
    if failure is not None:
        raise _with_alarm(failure, ended)
    return _result(out, ended, interrupted)


def _looped(
    loop: ControlLoop, eyes: Eyes, guard: GuardProcess, zero_frames: int, begin: Callable[[], None] | None
) -> RunError | None:
    """Rest position, then the loop; whatever happens in it, the guard is told to come down. Returns why it failed."""
    with _quiet_memory():
        try:
            zeroed_s = eyes.zero(zero_frames)
            if begin is not None:
                begin()
            loop.run(zeroed_s)
        except RunError as error:
            guard.trip("no_tip", str(error))
            return error
        except ClosedError:
            # the guard has gone; waiting for its end finds that out too, and replaces it
            return None
        except BaseException as error:
            guard.trip("controller_failed", f"{type(error).__name__}: {error}")
            ended = guard.wait()
            if ended.alarm:
                raise _with_alarm(error, ended) from error
            raise
        guard.stop()
    return None


def _with_alarm(error: BaseException, ended: Ended) -> RunError:
    """What to raise for `error`: an output that is not known to be off comes before everything else."""
    if ended.alarm:
        return OutputUnknownError(f"{ended.alarm}; the run failed: {error}")
    return error if isinstance(error, RunError) else RunError(str(error))


@contextlib.contextmanager
def _signals(loop: ControlLoop) -> Iterator[None]:
    """Signals end the loop at its next turn instead of tearing it apart, and do nothing to the way down.

    Only the main thread can take them.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def take(number: int, _: object) -> None:
        loop.signal = signal.Signals(number).name

    names = [name for name in _SIGNALS if hasattr(signal, name)]
    before = {name: signal.signal(getattr(signal, name), take) for name in names}
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)


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
    bench: BenchFile, emulated: EmulatedBench | None, calibration: Any, ends: contextlib.ExitStack
) -> tuple[Any, Eyes]:
    from bender_hil.camera.reader import Camera
    from bender_hil.vision.tracker import Tracker

    source = emulated.stream if emulated is not None else bench.camera.source
    if source is None:
        raise InputError("camera.source is missing")
    camera = Camera(source, frames_per_s=bench.camera.frames_per_s, settings=bench.camera_settings)
    opened = ends.enter_context(camera).opened
    return opened, CameraEyes(camera, Tracker(bench.vision, calibration))


def _supply(bench: BenchFile, emulated: EmulatedBench | None) -> SupplySettings:
    if emulated is None:
        if bench.supply is None:
            raise InputError("the bench has no supply")
        return bench.supply
    settings = bench.emulator
    model = settings.supply if settings is not None else "9115"
    baud = settings.baud if settings is not None else None
    return SupplySettings(emulated.resource, model=model, baud=baud)


def _plant(bench: BenchFile, fmu: Callable[[str], Path] | None) -> Path | None:
    if bench.emulator is None:
        return None
    if bench.emulator.fmu is not None:
        return bench.resolve(bench.emulator.fmu)
    if fmu is None:
        raise InputError("the emulated bench needs an FMU; name one in the bench file with emulator.fmu")
    model = bench.emulator.model
    return fmu(str(bench.resolve(model)) if model.endswith(".toml") else model)


def _delay_s(bench: BenchFile) -> float:
    if bench.camera.delay_s is not None:
        return bench.camera.delay_s
    return EMULATED_DELAY_S if bench.emulator is not None else 0.0


def _result(out: Path, ended: Ended, interrupted: bool) -> RunResult:
    log = read_run(out)
    record = to_record(log)
    path = None
    if record is not None:
        path = out / "record.csv"
        write_record(path, record)
    return RunResult(out, ended, interrupted, path, summarise(log))


def _plain(calibration: Any) -> dict[str, Any]:
    return {name: getattr(calibration, name) for name in calibration.__dataclass_fields__}


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version(), "system": platform.platform()}
    for package in _PACKAGES:
        with contextlib.suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def _hash(path: Path | None) -> str | None:
    if path is None or not path.is_file():
        return None
    return hashlib.sha256(path.read_bytes()).hexdigest()
