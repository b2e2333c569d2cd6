"""Any co-simulation FMU (FMI 2.0 or 3.0) with a voltage input and a displacement output as a plant."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NoReturn

from bender_loop.errors import InputError, RunError
from bender_loop.fmu.calls import step_calls
from bender_loop.fmu.file import co_simulation, read_description
from bender_loop.fmu.instance import FmuInstance
from bender_loop.fmu.ports import Setting, find_input, find_output, parameter_settings
from bender_loop.fmu.schedule import NO_SCHEDULE, Schedule
from bender_loop.records.further import Array, Further
from bender_loop.shell.closed_at_exit import ClosedAtExit
from bender_loop.tables.quantities import USUAL, Quantities

# Inputs of the trial that shows whether a saved state holds all of the FMU's memory.
_TRIAL_V = (1.0, 0.25, 0.75, 0.0)
_TRIAL_STEP_S = 0.01
# Beyond this a square overflows.
_UNREAL_UM = 1e100


class FmuPlant(ClosedAtExit):
    """An FMU behind the `Plant` protocol; one instance serves for all runs.

    Unpacking and loading happen once. `reset` restores the state saved after initialisation where the FMU can do
    that and a short trial shows that it forgets nothing; else it resets and initialises anew.

    Args:
        path: the FMU file.
        input_name: a Real input; None for the only one, or the one called `voltage`.
        output_name: a Real output; None for the only one, or the one called `displacement`.
        parameters: values by FMI name in the FMU's own units.
        start_s: time at which every run starts.
        quantities: units of what is commanded and read, where they are not V and um.

    Attributes:
        path: the FMU file.
        input: the variable that takes the voltage; without a declared unit it is in V.
        output: the variable that is read; without a declared unit it is in m.

    Raises:
        InputError: missing or damaged file, not a co-simulation FMU of FMI 2.0 or 3.0 for this platform, unknown
            variable, unfit parameter.
        RunError: the FMU fails to start.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        input_name: str | None = None,
        output_name: str | None = None,
        parameters: Mapping[str, float] | None = None,
        start_s: float = 0.0,
        quantities: Quantities = USUAL,
    ) -> None:
        self.path = Path(path)
        self._start_s = start_s
        self._description = read_description(self.path)
        self.input = find_input(self.path, self._description, input_name, quantities)
        self.output = find_output(self.path, self._description, output_name, quantities)
        self._to_input = 1.0 / self.input.internal
        self._to_um = self.output.internal
        self._parameters: dict[str, float] = {}
        self._schedule, self._begin_s = NO_SCHEDULE, 0.0
        self.set_parameters(parameters or {})
        interface = co_simulation(self._description)
        self._even_steps_only = not interface.canHandleVariableCommunicationStepSize
        self._restores = bool(interface.canGetAndSetFMUstate)
        self._instance = FmuInstance(self.path, self._description)
        self._closed = False
        try:
            self._advance, self._read = step_calls(
                self._instance, self.input.reference, self.output.reference, rollback=self._restores
            )
            self._initialise()
            self._restores = self._restores and self._try_restoring()
        except BaseException:
            self.close()
            raise
        self._stale = False
        self._rewind()

    @property
    def time_s(self) -> float:
        """The FMU's clock: since the start, k times the step while the step stays the same."""
        return self._origin_s if self._count == 0 else self._origin_s + self._count * self._step_s

    def set_parameters(self, parameters: Mapping[str, float]) -> None:
        """Set parameters by their FMI names, from the next reset on; those set before keep their values.

        Raises:
            InputError: unknown name, not a parameter, value out of the declared bounds.
        """
        parameter_settings(self.path, self._description, parameters)
        self._parameters.update(parameters)
        self._stale = True

    def follow(self, time_s: Array, further: Sequence[Further]) -> None:
        """Let further inputs follow a record from the next reset on; none leaves them as the FMU has them.

        Raises:
            InputError: there is no such input, it is the command, or its unit is of another quantity.
        """
        taken = (self.input.name,)
        schedule = Schedule.of(self.path, self._description, taken, time_s, further) if further else NO_SCHEDULE
        self._stale = self._stale or schedule != self._schedule
        self._schedule = schedule

    def begin_at(self, time_s: float) -> None:
        """Set the time of the record at which the next reset begins."""
        self._stale = self._stale or self._schedule.at(time_s) != self._schedule.at(self._begin_s)
        self._begin_s = time_s

    def reset(self) -> None:
        """Back to rest at the start, with the parameters that are set now.

        Raises:
            InputError: the FMU refuses the parameters.
            RunError: the FMU cannot be reset, or is closed.
        """
        if self._closed:
            self._fail_closed()
        used = self.time_s > self._start_s
        if self._stale or (used and not (self._restores and self._instance.restore())):
            self._stale = True
            self._instance.reset()
            self._initialise()
            self._stale = False
        self._rewind()

    def read(self) -> float:
        """The displacement in um now, without a step."""
        return self._read() * self._to_um

    def reader(self, output_name: str, quantities: Quantities = USUAL) -> Callable[[], float]:
        """Return a function that reads another output in the unit of its quantities, as `read` reads this one.

        Raises:
            InputError: there is no such output, or its unit is of another quantity.
        """
        port = find_output(self.path, self._description, output_name, quantities)
        _, read = step_calls(self._instance, self.input.reference, port.reference, rollback=self._restores)
        return lambda: read() * port.internal

    def step(self, voltage_V: float, step_s: float) -> float:
        """Advance by `step_s` under the held `voltage_V`; returns displacement_um at the end of the step.

        Raises:
            ValueError: the step is not > 0.
            InputError: the step changes and the FMU cannot handle that.
            RunError: the FMU reports an error; the next reset starts it afresh.
        """
        if step_s != self._step_s:
            step_s = self._change_step(step_s)
        if self._schedule.ports:
            self._instance.set_inputs(self._schedule.settings(self._begin_s + self.time_s - self._start_s))
        try:
            value = self._advance(voltage_V * self._to_input, self._origin_s + self._count * step_s, step_s)
        except RunError:
            self._stale = True
            raise
        reading_um = value * self._to_um
        if not abs(reading_um) < _UNREAL_UM:
            self._stale = True
            at_s = self._origin_s + self._count * step_s
            raise RunError(
                f"{self.path}: the output {self.output.name} is {value!r} after the step of {step_s!r} s from "
                f"t = {at_s!r} s at {voltage_V!r} V, expected a number of ordinary size; ask the maker of the FMU"
            )
        self._count += 1
        return reading_um

    @property
    def can_save(self) -> bool:
        """Whether the FMU can save its state, and forgets nothing of it."""
        return self._restores

    def save(self) -> object:
        """Return the FMU's state and time.

        Raises:
            RunError: the FMU cannot save its state.
        """
        return self._instance.state(), self._origin_s, self._carry_s, self._count, self._step_s

    def restore(self, state: object) -> None:
        """Go back to what `save` returned.

        Raises:
            RunError: the FMU cannot.
        """
        saved, self._origin_s, self._carry_s, self._count, self._step_s = state  # pyright: ignore[reportGeneralTypeIssues]
        self._instance.go_back(saved)

    def close(self) -> None:
        """Free the FMU and remove its unpacked files; a second call does nothing."""
        if not self._closed:
            self._closed = True
            self._advance = self._read = self._fail_closed
            self._instance.close()

    def _fail_closed(self, *_: float) -> NoReturn:
        raise RunError(f"{self.path}: the FMU is closed; open it again")

    def _initialise(self) -> None:
        settings = parameter_settings(self.path, self._description, self._parameters)
        try:
            further = self._schedule.settings(self._begin_s)
            command = Setting(self.input.type, self.input.reference, 0.0)
            self._instance.initialise([command, *further, *settings], self._start_s)
        except RunError as error:
            if not self._parameters:
                raise
            raise InputError(f"{error} (with parameters {self._parameters})") from error
        self._restores = self._restores and self._instance.save()

    def _try_restoring(self) -> bool:
        """Whether two runs from the restored state give the same bits; leaves the FMU at rest.

        FMUs exist that claim to save their state and save its visible part only.
        """
        first, second = self._trial(), self._trial() if self._instance.restore() else None
        if first is not None and first == second and self._instance.restore():
            return True
        self._instance.reset()
        self._restores = False
        self._initialise()
        return False

    def _trial(self) -> list[float] | None:
        experiment = self._description.defaultExperiment
        step = float(experiment.stepSize) if experiment is not None and experiment.stepSize else _TRIAL_STEP_S
        try:
            return [
                self._advance(voltage * self._to_input, self._start_s + index * step, step)
                for index, voltage in enumerate(_TRIAL_V)
            ]
        except RunError:
            return None

    def _rewind(self) -> None:
        self._origin_s, self._carry_s = self._start_s, 0.0
        self._count = 0
        self._step_s = math.nan

    def _change_step(self, step_s: float) -> float:
        """Begin a stretch of equal steps; the time before it is kept with its rounding error carried along."""
        if not (math.isfinite(step_s) and step_s > 0.0):
            raise ValueError(f"step_s must be a finite number > 0, found {step_s!r}")
        if self._even_steps_only and self._count:
            if abs(step_s - self._step_s) <= 1e-9 * self._step_s:
                return self._step_s
            raise InputError(
                f"{self.path}: the FMU takes equal steps only (canHandleVariableCommunicationStepSize is false), "
                f"found {step_s!r} s after {self._step_s!r} s; use a record with even sampling"
            )
        if self._count:
            terms = [self._origin_s, self._carry_s, self._count * self._step_s]
            self._origin_s = math.fsum(terms)
            self._carry_s = math.fsum([*terms, -self._origin_s])
        self._count = 0
        self._step_s = step_s
        return step_s
