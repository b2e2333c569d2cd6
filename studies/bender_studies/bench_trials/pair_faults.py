"""Faults over pairs of source and sensor: whatever fails, the output is off or an alarm is given in time."""

import itertools
import time
from dataclasses import dataclass
from pathlib import Path

from bender_emulator.microscope.control import clear_faults, set_fault
from bender_hil.bench_file import BenchFile, CameraTable
from bender_hil.calibration.scale import Calibration
from bender_hil.emulated import MICROSCOPE, EmulatedBench, EmulationSettings
from bender_hil.guard.guard import Status
from bender_hil.guard.settings import GuardSettings
from bender_hil.guard.start import OutputUnknownError
from bender_hil.log.read_run import GUARD, read_run
from bender_hil.runner.program import OpenLoop
from bender_hil.runner.run import run
from bender_hil.runner.tip_camera import Sight
from bender_hil.runner.voltages import Voltages
from bender_hil.sensors.table import SensorTable
from bender_hil.sources.amplifier import Amplifier
from bender_loop.errors import InputError, RunError

SOURCES = ("9115", "33500", "SDG", "MDT693B", "GCS", "daq")
SENSORS = (MICROSCOPE, "DMM6500", "34465A", "RedPitaya", "DSOX", "text", "daq")
PAIRS = tuple(itertools.product(SOURCES, SENSORS))
AMPLIFIER = Amplifier(20.0)
"""Behind a generator."""

Switches = tuple[tuple[str, float | str], ...]

SOURCE_FAULTS: dict[str, Switches] = {
    "source: link drops": (("drop_link", 1),),
    "source: link drops for good": (("refuse", 1), ("drop_link", 1)),
    "source: no answers": (("no_reply", "for ever"),),
    "source: hangs": (("hung", 1),),
    "source: garbled answers": (("garble", "for ever"),),
    "source: takes nothing any more": (("deaf", 1),),
    "source: cannot be brought to 0 V": (("stuck_on", 1),),
    "source: another one answers": (("other_model", "9116"), ("drop_link", 1)),
}
SENSOR_FAULTS: dict[str, Switches] = {
    "sensor: hangs": (("hung", 1),),
    "sensor: link drops for good": (("refuse", 1), ("drop_link", 1)),
    "sensor: nonsense": (("reading_V", "nonsense"),),
    "sensor: says the same for ever": (("frozen", 1),),
    "sensor: overload": (("reading_V", "9.9E37"),),
    "sensor: scatters": (("noise_um", 8.0),),
    "sensor: jumps away": (("travel_um", 90.0),),
}
CAMERA_FAULTS = {
    "sensor: hangs": "stall", "sensor: link drops for good": "drop", "sensor: nonsense": "garble",
    "sensor: says the same for ever": "freeze", "sensor: jumps away": "away",
}  # fmt: skip
"""What a camera has of the same kind; an overload and a scatter it has not."""
DAQ_FAULTS: dict[str, Switches] = {"sensor: jumps away": (("travel_um", 90.0),)}
"""The stand-in of a DAQ has no faults of its own; its driver fails with the whole computer, as the source's does."""
HARMLESS = ("source: link drops",)
"""A run may go on, or end as planned."""

LIMITS = GuardSettings(
    heartbeat_s=1.0, frame_age_s=0.6, shutdown_limit_s=1.0, discharge_limit_s=1.0, travel_um=(-10.0, 60.0)
)
_LEVEL_V, _LONGEST_S, _TICK = 15.0, 6.0, 12
_ALLOWED_S = 1.0
_LIVE_V = 1.0


@dataclass(frozen=True, slots=True)
class PairCell:
    """One run with one fault.

    Attributes:
        source, sensor: of the pair.
        fault: its name.
        outcome: "off", "alarm", or "refused" before anything was switched on.
        code: why the run ended, None where it did not.
        seconds: from the reason for the end to the output off or the alarm; None where nothing was on.
        noticed_s: from the fault to the reason for the end; None where it is not known.
        broken: what should not be; "" for a cell that is in order.
    """

    source: str
    sensor: str
    fault: str
    outcome: str
    code: str | None
    seconds: float | None
    noticed_s: float | None
    broken: str


def faults_of(sensor: str) -> list[str]:
    """Return the names of the faults that a pair with this sensor has."""
    own = {MICROSCOPE: CAMERA_FAULTS, "daq": DAQ_FAULTS}.get(sensor, SENSOR_FAULTS)
    return [*SOURCE_FAULTS, *own]


def pair_bench(source: str, sensor: str, fmu: Path) -> EmulatedBench:
    """Return a running emulated bench of that pair."""
    settings = EmulationSettings(supply=source, sensor=sensor)
    return EmulatedBench(settings, fmu, 30.0, amplifier=_amplifier(source))


def run_pair_cell(bench: EmulatedBench, source: str, sensor: str, fault: str, folder: Path) -> PairCell:
    """One run on a running emulated bench, driven as hardware is; leaves it mended.

    Args:
        bench: of that pair, that nobody else uses.
        source: of the pair.
        sensor: of the pair.
        fault: one of `faults_of`.
        folder: where the run goes, not there yet.
    """
    bench.supply.make_ready()
    # what a hung instrument had still to carry out, it has carried out by now
    bench.supply.power_on()
    _mend_sensor(bench)
    folder.mkdir(parents=True)
    as_hardware = _as_hardware(bench, source, sensor, folder)
    seen, fault_s = 0, None

    def look_on(_: Sight) -> None:
        nonlocal seen, fault_s
        seen += 1
        if seen == _TICK:
            fault_s = time.perf_counter()
            _spoil(bench, sensor, fault)

    outcome, code, refusal = "refused", None, ""
    try:
        profile = OpenLoop(Voltages((0.0,), (_LEVEL_V,), _LONGEST_S))
        result = run(as_hardware, profile, folder / "run", witness=look_on)
        outcome = "alarm" if result.ended.status is Status.UNCONFIRMED else "off"
        code = result.ended.code
    except OutputUnknownError:
        outcome = "alarm"
    except (InputError, RunError) as error:
        refusal = str(error)
    seconds, noticed_s = _times(folder / "run", fault_s, outcome)
    _mend_sensor(bench)
    truth = bench.supply.truth()
    broken = f"the run did not begin: {refusal}" if outcome == "refused" else ""
    broken = broken or _broken(fault, outcome, code, seconds, abs(float(truth["output_V"])))
    return PairCell(source, sensor, fault, outcome, code, seconds, noticed_s, broken)


def _as_hardware(bench: EmulatedBench, source: str, sensor: str, folder: Path) -> BenchFile:
    settings = EmulationSettings(supply=source, sensor=sensor)
    instrument, amplifier = settings.source(bench.resource), _amplifier(source)
    if sensor == MICROSCOPE:
        Calibration.told(1.5).save(folder / "calibration.toml")
        camera = CameraTable(source=bench.stream, calibration=str(folder / "calibration.toml"), zero_frames=5)
        return BenchFile(source=instrument, amplifier=amplifier, camera=camera, guard=LIMITS)
    calibration = settings.sensor_calibration()
    if calibration is not None:
        calibration.save(folder / "sensor.toml")
    told = settings.sensor_table(str(bench.sensor_resource))
    path = None if calibration is None else str(folder / "sensor.toml")
    table = SensorTable(told.kind, told.instrument, told.rate_Hz, calibration=path)
    return BenchFile(source=instrument, amplifier=amplifier, sensor=table, guard=LIMITS)


def _amplifier(source: str) -> Amplifier | None:
    return AMPLIFIER if source in ("33500", "SDG", "daq") else None


def _spoil(bench: EmulatedBench, sensor: str, fault: str) -> None:
    if fault in SOURCE_FAULTS:
        for name, value in SOURCE_FAULTS[fault]:
            bench.supply.fault(name, value)
    elif sensor == "daq":
        for name, value in DAQ_FAULTS[fault]:
            bench.supply.fault(name, value)
    elif sensor == MICROSCOPE:
        set_fault(bench.control_port, CAMERA_FAULTS[fault])
    else:
        for name, value in SENSOR_FAULTS[fault]:
            bench.supply.sensor_fault(name, value)


def _mend_sensor(bench: EmulatedBench) -> None:
    if bench.sensor_resource is None:
        clear_faults(bench.control_port)
    elif bench.supply.sensor_resource is not None:
        bench.supply.mend_sensor()


def _times(folder: Path, fault_s: float | None, outcome: str) -> tuple[float | None, float | None]:
    """From the reason for the end to the output off or the alarm, and from the fault to that reason."""
    if outcome == "refused" or not (folder / GUARD).exists():
        return None, None
    log = read_run(folder)
    ramp, end = log.guard_entry("ramp"), log.guard_entry("end")
    rescued = [entry for entry in log.events if entry["kind"] == "stop"]
    if ramp is None:
        return None, None
    last = end if end is not None else rescued[-1] if rescued else None
    began_s = float(ramp["t"])
    noticed_s = None if fault_s is None else began_s - fault_s
    if last is None:
        return None, noticed_s
    off_s = last.get("off_s")
    return float(last["t"] if off_s is None else off_s) - began_s, noticed_s


def _broken(fault: str, outcome: str, code: str | None, seconds: float | None, output_V: float) -> str:
    if outcome == "off" and output_V > _LIVE_V:
        return f"{output_V:.2f} V are at the actuator, and it was said to be off"
    # what shows only when the output has to come down is told then, by the alarm
    if outcome == "off" and code is None and fault not in HARMLESS:
        return "nobody noticed"
    if seconds is not None and seconds > LIMITS.shutdown_limit_s + _ALLOWED_S:
        return f"it took {seconds:.2f} s"
    return ""
