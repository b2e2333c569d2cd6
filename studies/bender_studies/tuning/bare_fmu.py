"""The other ways to the same step response: fmpy's bare calls, and `simulate_fmu` with the controller in its callback.

Neither does anything that it need not do.
"""

import shutil
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import fmpy
from fmpy.fmi2 import FMU2Slave
from fmpy.simulation import simulate_fmu

from bender_loop.control import pid
from bender_loop.control.pid import Gains
from bender_studies.tuning.plants import LIMITS, BenchmarkPlant

_UM_PER_M = 1e6
_INPUT, _OUTPUT = "voltage", "displacement"


class BareFmu:
    """A plant FMU of this project unpacked and instantiated once by fmpy's low-level interface.

    Args:
        fmu: the FMU file.
    """

    def __init__(self, fmu: Path) -> None:
        self.description = fmpy.read_model_description(str(fmu))
        references = {variable.name: variable.valueReference for variable in self.description.modelVariables}
        self.input, self.output = [references[_INPUT]], [references[_OUTPUT]]
        self.folder = tempfile.mkdtemp(prefix="bender-bare-fmu-")
        fmpy.extract(str(fmu), self.folder)
        interface: Any = self.description.coSimulation
        self.slave = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=interface.modelIdentifier,
            instanceName="bare",
        )
        self.slave.instantiate()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.slave.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)

    def round_trips_s(self, voltages_V: Sequence[float], step_s: float) -> tuple[float, float]:
        """Set, step and get once per voltage, from rest; returns (wall time of these, last displacement_um)."""
        slave, taken, given = self.slave, self.input, self.output
        slave.reset()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        value = 0.0
        began = time.perf_counter()
        for tick, voltage in enumerate(voltages_V):
            slave.setReal(taken, [voltage])
            slave.doStep(currentCommunicationPoint=tick * step_s, communicationStepSize=step_s)
            value = slave.getReal(given)[0]
        return time.perf_counter() - began, value * _UM_PER_M


def mse_by_simulate_fmu(fmu: Path, plant: BenchmarkPlant, gains: Gains, bare: BareFmu, *, reuse: bool) -> float:
    """MSE of the closed loop in um^2, run by one call of `simulate_fmu` with the PID block in `step_finished`.

    Args:
        fmu: the FMU file.
        plant: the loop; without latency and with one plant step per frame.
        gains: of the PID block.
        bare: the same FMU; its value references are used, and with `reuse` its instance.
        reuse: give `simulate_fmu` what is unpacked, read and instantiated already, and reset the instance; otherwise
            it gets the file name alone and does all of that itself.
    """
    period_s, setpoint_um = plant.sampling.period_s, plant.setpoint_um
    state, command = pid.step(gains, LIMITS, pid.PidState(), setpoint_um, 0.0, period_s)

    def control(_time_s: float, recorder: Any) -> bool:
        nonlocal state, command
        reading_um = recorder.rows[-1][1] * _UM_PER_M
        state, command = pid.step(gains, LIMITS, state, setpoint_um, reading_um, period_s)
        recorder.fmu.setReal(bare.input, [command])
        return True

    settings: dict[str, Any] = {
        "stop_time": plant.duration_s,
        "output_interval": period_s,
        "start_values": {_INPUT: command},
        "output": [_OUTPUT],
        "step_finished": control,
    }
    if reuse:
        bare.slave.reset()
        result = simulate_fmu(bare.folder, model_description=bare.description, fmu_instance=bare.slave, **settings)
    else:
        result = simulate_fmu(str(fmu), **settings)
    errors = setpoint_um - result[_OUTPUT] * _UM_PER_M
    return float((errors**2).mean())
