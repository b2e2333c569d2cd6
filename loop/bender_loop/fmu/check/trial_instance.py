"""One instance of an FMU with all its real inputs moved alike and all its real outputs read."""

from pathlib import Path
from typing import Any

from fmpy.fmi1 import FMICallException
from fmpy.model_description import ModelDescription

from bender_loop.errors import RunError
from bender_loop.fmu.file import is_fmi3
from bender_loop.fmu.instance import FmuInstance
from bender_loop.fmu.ports import is_port
from bender_loop.shell.closed_at_exit import ClosedAtExit

_STEP_S = 0.01


class TrialInstance(ClosedAtExit):
    """An FMU under trial; inputs swing about their start values by a tenth of their nominal size, or of one.

    Attributes:
        inputs: names of the Real inputs.
        outputs: names of the Real outputs, as `step` returns them.
        time_s: the communication point.

    Raises:
        InputError: the archive is damaged or its binary cannot be loaded.
        RunError: the FMU refuses to be instantiated.
    """

    def __init__(self, path: Path, description: ModelDescription) -> None:
        reals = [variable for variable in description.modelVariables if is_port(variable)]
        inputs = [variable for variable in reals if variable.causality == "input"]
        outputs = [variable for variable in reals if variable.causality == "output"]
        self.inputs, self.outputs = [v.name for v in inputs], [v.name for v in outputs]
        self._input_references = [v.valueReference for v in inputs]
        self._output_references = [v.valueReference for v in outputs]
        self._rests = [float(v.start or 0.0) for v in inputs]
        self._swings = [0.1 * float(v.nominal or 1.0) for v in inputs]
        experiment = description.defaultExperiment
        self.step_s = float(experiment.stepSize) if experiment is not None and experiment.stepSize else _STEP_S
        self.time_s = 0.0
        self._prefix = "fmi3" if is_fmi3(description) else "fmi2"
        self._owner = FmuInstance(path, description)
        self._states: list[Any] = []

    def begin(self, start_s: float = 0.0) -> None:
        """Initialise."""
        self.time_s = start_s
        self._owner.initialise((), start_s=start_s)

    def reset(self) -> None:
        """Back to instantiated, by the FMU's own reset and by nothing else."""
        self._free_states()
        self._call(f"{self._prefix}Reset", lambda slave: slave.reset())

    def step(self, swing: float, parts: int = 1) -> list[float]:
        """Hold the inputs for one communication step, taken in equal parts; returns the outputs."""
        values = [rest + swing * size for rest, size in zip(self._rests, self._swings, strict=True)]
        if values:
            self._call(f"{self._prefix}SetReal", lambda slave: slave.setReal(self._input_references, values))
        for k in range(parts):
            self._advance(self.time_s + k * self.step_s / parts, self.step_s / parts)
        self.time_s += self.step_s
        if not self.outputs:
            return []
        return list(self._call(f"{self._prefix}GetReal", lambda slave: slave.getReal(self._output_references)))

    def saved(self) -> Any:
        """Save the state."""
        state = self._call(f"{self._prefix}GetFMUstate", lambda slave: slave.getFMUstate())
        self._states.append(state)
        return state

    def restore(self, state: Any) -> None:
        """Back to a saved state."""
        self._call(f"{self._prefix}SetFMUstate", lambda slave: slave.setFMUstate(state))

    def serialised(self) -> bytes:
        """Save the state as bytes."""
        state = self.saved()
        return bytes(self._call(f"{self._prefix}SerializeFMUstate", lambda slave: slave.serializeFMUstate(state)))

    def deserialise(self, data: bytes) -> None:
        """Back to a state of bytes."""
        state = self._call(f"{self._prefix}DeSerializeFMUstate", lambda slave: slave.deSerializeFMUstate(data))
        self._states.append(state)
        self.restore(state)

    def close(self) -> None:
        """Free everything."""
        self._free_states()
        self._owner.close()

    def _advance(self, at_s: float, length_s: float) -> None:
        self._call(f"the step of {length_s!r} s from t = {at_s!r} s", lambda slave: slave.doStep(at_s, length_s))

    def _free_states(self) -> None:
        for state in self._states:
            self._call(f"{self._prefix}FreeFMUstate", lambda slave, state=state: slave.freeFMUstate(state))
        self._states.clear()

    def _call(self, action: str, call: Any) -> Any:
        try:
            return call(self._owner.slave)
        except FMICallException as problem:
            raise self._owner.failure(action, problem.status) from problem
        except (OSError, ValueError) as problem:  # an access violation on Windows
            raise RunError(f"{action} failed ({problem})") from problem
