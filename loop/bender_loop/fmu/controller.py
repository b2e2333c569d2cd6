"""Any co-simulation FMU that takes a set-point and a measurement and gives a command, as a controller."""

import math
from collections.abc import Mapping
from pathlib import Path

from fmpy.fmi1 import FMICallException

from bender_loop.errors import RunError
from bender_loop.fmu.file import co_simulation, read_description
from bender_loop.fmu.instance import FmuInstance
from bender_loop.fmu.ports import Setting, find_controller_ports, parameter_settings
from bender_loop.shell.closed_at_exit import ClosedAtExit


class FmuController(ClosedAtExit):
    """A controller FMU, sampled: one communication step is one sample.

    Args:
        path: the FMU, of FMI 2.0 or 3.0.
        period_s: length of the steps of an FMU that takes equal ones only.
        names: of set-point, measurement and command.
        parameters: values by FMI name, in the FMU's own units.

    Raises:
        InputError: missing or damaged FMU, no such variables, an unfit parameter.
        RunError: the FMU fails to start.
    """

    def __init__(
        self,
        path: Path,
        period_s: float,
        names: tuple[str, str, str] = ("setpoint", "measurement", "command"),
        parameters: Mapping[str, float] | None = None,
    ) -> None:
        self.path, self._period_s = path, period_s
        description = read_description(path)
        self._setpoint, self._measurement, self._command = find_controller_ports(path, description, names)
        settings = parameter_settings(path, description, parameters or {})
        self._even = not co_simulation(description).canHandleVariableCommunicationStepSize
        self._time_s = 0.0
        self._instance = FmuInstance(path, description)
        try:
            self._instance.initialise(settings)
        except BaseException:
            self.close()
            raise

    def step(self, setpoint_um: float, measurement_um: float, dt_s: float) -> float:
        """Take one sample; returns the command in V.

        Raises:
            RunError: the FMU reports an error, or its command is no finite number.
        """
        step_s = self._period_s if self._even else dt_s
        inputs = ((self._setpoint, setpoint_um), (self._measurement, measurement_um))
        self._instance.set_inputs(Setting(x.type, x.reference, value / x.internal) for x, value in inputs)
        slave = self._instance.slave
        try:
            slave.doStep(self._time_s, step_s)
            command_V = float(slave.getReal([self._command.reference])[0]) * self._command.internal
        except FMICallException as error:
            raise self._instance.failure(f"the step from t = {self._time_s!r} s", error.status) from error
        self._time_s += step_s
        if not math.isfinite(command_V):
            raise RunError(f"{self.path}: the command is {command_V!r} V at t = {self._time_s!r} s, expected a number")
        return command_V

    def close(self) -> None:
        """Free the FMU; a second call does nothing."""
        self._instance.close()
