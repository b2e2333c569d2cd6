"""A loop at 1 kHz on the emulated DAQ: whether its commands come before the next reading, and how long they take.

Readings are means over the whole time between two, so that a delay counts from where a reading is complete. The clock
of the emulated device is that of this machine; the load of the machine stands beside the figures.
"""

import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bender_hil.bench_file import BenchFile, ControllerTable
from bender_hil.emulated import EmulationSettings
from bender_hil.guard.settings import GuardSettings
from bender_hil.log.read_run import RunLog
from bender_hil.log.summary import applied_times
from bender_hil.realtime import priority
from bender_hil.runner.program import Program
from bender_hil.runner.run import run
from bender_hil.sources.amplifier import Amplifier

RATE_HZ = 1000.0
ALONE_S = 20.0
AMPLIFIER = Amplifier(20.0)
LIMITS = GuardSettings(minimum_V=-50.0, frame_age_s=0.5, heartbeat_s=0.5)
"""Patient: a machine that is busy for a moment shows in the figures and does not end the run."""


@dataclass(frozen=True, slots=True)
class Kilohertz:
    """What a loop at 1 kHz kept up.

    Attributes:
        code: of the rule that ended it, None where none did.
        ticks: readings that led to a command.
        skipped: readings that the loop passed over.
        late: ticks whose command came after the next reading was complete, or was overtaken.
        delay_ms: from a complete reading to its command on the wire: median, 99th percentile, maximum.
        alone: of the waits of a millisecond in `ALONE_S` before the run, by a process that does nothing else, those
            that lasted a whole millisecond too long: what no loop on this machine can keep up.
        load: of the machine before the run: processes that want a processor, mean of a minute.
        processors: that there are.
    """

    code: str | None
    ticks: int
    skipped: int
    late: int
    delay_ms: tuple[float, float, float]
    alone: int
    load: float
    processors: int


def measure_kilohertz(program: Program, fmu: Path, out: Path, *, realtime: bool = False) -> Kilohertz:
    """Run `program` at 1 kHz on an emulated DAQ into the directory `out`.

    Args:
        program: what to do.
        fmu: the plant.
        out: where the run goes.
        realtime: whether the run has priority over what else the machine does.
    """
    load = os.getloadavg()[0]
    with priority(realtime):
        alone = late_waits(ALONE_S)
    emulator = EmulationSettings(
        fmu=str(fmu.resolve()), supply="daq", sensor="daq", sensor_settings={"rate_Hz": RATE_HZ}
    )
    bench = BenchFile(
        emulator=emulator,
        sensor=emulator.sensor_table(""),
        amplifier=AMPLIFIER,
        guard=LIMITS,
        controller=ControllerTable(realtime=realtime),
    )
    result = run(bench, program, out)
    summary = result.summary
    delays_ms = complete_to_command_ms(result.log)
    spread = (float("nan"),) * 3 if not len(delays_ms) else tuple(np.percentile(delays_ms, [50.0, 99.0, 100.0]))
    median_ms, high_ms, most_ms = (float(value) for value in spread)
    return Kilohertz(
        result.ended.code, summary.ticks, summary.skipped, summary.late, (median_ms, high_ms, most_ms), alone, load,
        os.cpu_count() or 1,
    )  # fmt: skip


def late_waits(duration_s: float) -> int:
    """Return how many waits until the next millisecond, over `duration_s`, ended more than another one late."""
    tick_s = 1.0 / RATE_HZ
    late, due_s = 0, time.perf_counter()
    end_s = due_s + duration_s
    while due_s < end_s:
        due_s += tick_s
        time.sleep(max(0.0, due_s - time.perf_counter()))
        over_s = time.perf_counter() - due_s
        if over_s > tick_s:
            late += 1
            due_s += over_s
    return late


def complete_to_command_ms(log: RunLog) -> np.ndarray:
    """Return how long after the end of its reading each command was on the wire."""
    applied = applied_times(log)
    half_s = 0.5 * float(log.start.get("exposure_s") or 0.0)
    return np.array(
        [
            1e3 * (applied[tick["sequence"]] - tick["grabbed_s"] - half_s)
            for tick in log.ticks
            if tick["sequence"] in applied
        ]
    )
