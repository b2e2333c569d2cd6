"""Faults over pairs of source and sensor: whatever fails, the output is off or an alarm is given in time."""

import itertools
import time
from dataclasses import dataclass
from pathlib import Path

from bench_trials.whole_run import WholeRun, code_of, first_of, has_stood, hil_words, journal_of, last_word_faults

from bender_emulator.microscope.control import clear_faults, set_fault
from bender_hil.emulated import MICROSCOPE, EmulatedBench, EmulationSettings
from bender_hil.guard.settings import GuardSettings
from bender_hil.log.read_run import RUN
from bender_hil.sources.amplifier import Amplifier
from bender_loop.errors import RunError
from bender_loop.shell.last_word import UNCONFIRMED
from bender_studies.bench_trials.as_hardware import HARMLESS_V, write_bench

SOURCES = ("9115", "33500", "SDG", "MDT693B", "GCS", "daq")
SENSORS = (MICROSCOPE, "DMM6500", "34465A", "RedPitaya", "DSOX", "text", "daq")
PAIRS: tuple[tuple[str, str], ...] = tuple(itertools.product(SOURCES, SENSORS))
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
_LEVEL_V, _LONGEST_S = 15.0, 3.0
_ALLOWED_S, _PATIENCE_S = 1.0, 30.0


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
    settings = EmulationSettings(supply=source, sensor=sensor)
    file = write_bench(folder, bench, settings, LIMITS, _amplifier(source))
    run = WholeRun(hil_words(file, ((0.0, _LEVEL_V), (_LONGEST_S, _LEVEL_V)), folder / "run"), folder)
    try:
        run.wait_for(bench.supply, has_stood(_LEVEL_V, 0.2))
        fault_s = time.perf_counter()
        _spoil(bench, sensor, fault)
        status = run.end(_LONGEST_S + _PATIENCE_S)
    except RunError as error:
        return PairCell(source, sensor, fault, "refused", None, None, None, f"the run did not begin: {error}")
    finally:
        run.end(0.0)
        _mend_sensor(bench)
    live = abs(float(bench.supply.truth()["output_V"])) >= HARMLESS_V
    outcome, code = "alarm" if status == UNCONFIRMED else "off", code_of(folder / "run")
    seconds, noticed_s = _times(folder / "run", fault_s)
    faults = last_word_faults(status, run.printed(), run.said(), is_live=live)
    # what shows only when the output has to come down is told then, by the alarm
    if outcome == "off" and code is None and fault not in HARMLESS:
        faults.append("nobody noticed")
    if seconds is not None and seconds > LIMITS.shutdown_limit_s + _ALLOWED_S:
        faults.append(f"it took {seconds:.2f} s")
    if status is None:
        faults.append("no end")
    return PairCell(source, sensor, fault, outcome, code, seconds, noticed_s, "; ".join(faults))


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


def _times(folder: Path, fault_s: float) -> tuple[float | None, float | None]:
    """From the reason for the end to the output off or the alarm, and from the fault to that reason."""
    guard, run = journal_of(folder), journal_of(folder, RUN)
    ramp, last = first_of(guard, "ramp"), first_of(guard, "end") or first_of(run, "stop")
    if ramp is None:
        return None, None
    began_s = float(ramp["t"])
    if last is None:
        return None, began_s - fault_s
    off_s = last.get("off_s")
    return float(last["t"] if off_s is None else off_s) - began_s, began_s - fault_s
