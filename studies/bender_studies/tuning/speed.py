"""What an evaluation costs, as a ratio within one run where that is possible.

Everything is repeated. The best of the repeats is what the code costs and what the targets are judged by, since other
programs on the machine only ever add to a time; the median says how busy the machine was. The loop and the bare calls
of fmpy are measured in turns, so that both sides see the same machine.
"""

import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from bender_loop.control.closed_loop import simulate
from bender_loop.control.pid import Gains
from bender_loop.control.references import Step
from bender_loop.errors import RunError
from bender_loop.fmu.plant import FmuPlant
from bender_studies.tuning.method_runs import MethodTask
from bender_studies.tuning.plants import LIMITS, PLANTS, Problem
from bender_tuner.optimisers import DEFAULT_BUDGET

PLANT = PLANTS[0]
METHOD = "bas"
STEP_RUNS, TUNINGS, STARTS = 200, 7, 9
"""How often each is repeated, unless told."""
IMPORT = "import time; began = time.perf_counter(); import piezo_bender; print(time.perf_counter() - began)"
_UM_PER_M, _SAME = 1e6, 1e-9


@dataclass(frozen=True, slots=True)
class Figure:
    """One line of the result: best and median of the repeats, held to a target where there is one."""

    what: str
    unit: str
    best: float
    median: float
    at_most: float | None = None

    @property
    def met(self) -> bool | None:
        """Whether the best keeps the target; None without one."""
        return None if self.at_most is None else self.best <= self.at_most


def measure_speed(fmu: Path, repeats: int | None) -> Iterator[Figure]:
    """Yield the figures of the loop of 100 Hz, a run of 2 s, and of the start of the command line."""
    problem = Problem(PLANT, fmu)
    try:
        with bare_fmu(fmu) as bare, FmuPlant(fmu) as plant:
            pairs = [_timed_pair(plant, bare, problem.guess) for _ in range(repeats or STEP_RUNS)]
        step, round_trip = ([1e6 * x for x in times] for times in zip(*pairs, strict=True))
        yield _figure("bare fmpy round trip (setReal, doStep, getReal)", "us", round_trip, 25.0)
        yield _figure("closed-loop step through FmuPlant, PID included", "us", step)
        best, median = min(step) / min(round_trip), statistics.median(step) / statistics.median(round_trip)
        yield Figure("closed-loop step over round trip", "1", best, median, 1.3)
        tunings = [MethodTask(METHOD, 0, DEFAULT_BUDGET)(problem).time_s for _ in range(repeats or TUNINGS)]
        what = f"{(DEFAULT_BUDGET - 1) // 3} BAS iterations ({DEFAULT_BUDGET} evaluations)"
        yield _figure(what, "s", tunings, 1.0)
    finally:
        problem.close()
    starts = range(repeats or STARTS)
    yield _figure("bender --help, wall time", "s", [_started("-m", "bender_cli", "--help")[0] for _ in starts], 0.4)
    yield _figure("import piezo_bender", "s", [float(_started("-c", IMPORT)[1]) for _ in starts], 0.3)


def _figure(what: str, unit: str, found: Sequence[float], at_most: float | None = None) -> Figure:
    return Figure(what, unit, min(found), statistics.median(found), at_most)


@contextmanager
def bare_fmu(fmu: Path) -> Iterator[tuple[FMU2Slave, list[int], list[int]]]:
    """Give a plant FMU of this project instantiated by fmpy alone, with the references of its input and output."""
    description = fmpy.read_model_description(str(fmu))
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    folder = tempfile.mkdtemp(prefix="bender-bare-fmu-")
    fmpy.extract(str(fmu), folder)
    interface: Any = description.coSimulation
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=interface.modelIdentifier,
        instanceName="bare",
    )
    slave.instantiate()
    try:
        yield slave, [references["voltage"]], [references["displacement"]]
    finally:
        slave.freeInstance()
        shutil.rmtree(folder, ignore_errors=True)


def _timed_pair(plant: FmuPlant, bare: tuple[FMU2Slave, list[int], list[int]], gains: Gains) -> tuple[float, float]:
    """Seconds per step of one run in the closed loop, and of the bare calls after it with the very same voltages."""
    step_s = PLANT.sampling.period_s
    began = time.perf_counter()
    trace = simulate(plant, gains, LIMITS, Step(PLANT.setpoint_um), PLANT.sampling, PLANT.duration_s)
    loop_s = time.perf_counter() - began
    slave, taken, given = bare
    slave.reset()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    value_m, volts = 0.0, trace.voltage_V[:-1].tolist()
    began = time.perf_counter()
    for tick, voltage in enumerate(volts):
        slave.setReal(taken, [voltage])
        slave.doStep(currentCommunicationPoint=tick * step_s, communicationStepSize=step_s)
        value_m = slave.getReal(given)[0]
    bare_s = time.perf_counter() - began
    ours, theirs = float(trace.displacement_um[-1]), value_m * _UM_PER_M
    if not np.isclose(ours, theirs, rtol=_SAME, atol=_SAME):
        raise RunError(f"the last displacement in µm differs between closed loop and fmpy: {ours!r} and {theirs!r}")
    return loop_s / len(volts), bare_s / len(volts)


def _started(*words: str) -> tuple[float, str]:
    """Start Python; returns the wall time and what it printed."""
    began = time.perf_counter()
    done = subprocess.run([sys.executable, "-P", *words], capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - began
    if done.returncode != 0:
        raise RunError(f"{' '.join(words)} ended with status {done.returncode}, expected 0: {done.stderr[-300:]}")
    return seconds, done.stdout
