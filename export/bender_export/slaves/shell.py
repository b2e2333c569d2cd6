"""What the slaves of both FMUs share: values by reference, bounds, errors that say why, complete states.

Carried inside every FMU. A slave is described by a table of variables, inputs first, then outputs, then parameters; a
value reference is a place in that table. The values live in one list, so that a round trip (set, step, get) costs
little above PythonFMU's own.
"""

import atexit
import json
import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, TypeVar, cast

from pythonfmu import Fmi2Slave

_Call = TypeVar("_Call", bound=Callable[..., Any])
_LET_GO: set[str] = set()
HELD: list[dict[str, Any]] = []


def errors_for_host(call: _Call) -> _Call:
    """Let a call from the host raise without harm: the host is given an FMI error with the message.

    PythonFMU's library drops its references to the instance, its class and its log when a call raises, and drops
    them again when the instance is freed. One more of each keeps the second drop from freeing what is in use.
    """

    @wraps(call)
    def kept_alive(self: Any, *arguments: Any) -> Any:
        try:
            return call(self, *arguments)
        except BaseException:
            for held in (self, type(self), self.log_queue):
                _hold(held)
            raise

    return cast("_Call", kept_alive)


class Row(NamedTuple):
    """One FMI variable: unit "1" for none, infinite bounds for none, a bool as start for a Boolean variable."""

    name: str
    causality: str
    variability: str
    unit: str
    start: float
    minimum: float
    maximum: float
    description: str


class Shell(Fmi2Slave):
    """A slave over a table of variables; subclasses add `step`, `rest` and `parameters_changed`.

    They raise ValueError for what cannot be; the message says which variable, what was found and what was expected.
    """

    IDENTITY: ClassVar[str] = ""

    def __init__(self, table: tuple[Row, ...], **kwargs: Any) -> None:
        super().__init__(**kwargs)
        release_interpreter_once(self.resources)
        if self.resources in sys.path[1:] and sys.path[0] == self.resources:
            del sys.path[0]  # PythonFMU puts it there for every instance
        self.table = table
        self.values: list[Any] = [row.start for row in table]
        self.input_count = sum(row.causality == "input" for row in table)
        self.first_parameter = sum(row.causality != "parameter" for row in table)
        self.start_time_s = 0.0
        self.initialised = False
        self.memory: Any = None

    def rest(self) -> None:
        """Put memory and outputs where they are before the first step."""

    def step(self, current_time: float, step_size: float) -> None:
        """Go one communication step further."""
        raise NotImplementedError

    def parameters_changed(self) -> None:
        """Take notice of new parameter values; raises nothing, a combination that cannot be fails at its first use."""

    def recalled(self, memory: Any) -> Any:
        """Return a memory, which may have been to JSON and back (plain tuples), in the form that the kernel takes."""
        return memory

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        """Remember where time starts; stop time and tolerance change nothing in an exact discretisation."""
        del stop_time, tolerance
        self.start_time_s = start_time

    @errors_for_host
    def exit_initialization_mode(self) -> None:
        """Settle the fixed parameters and start at rest."""
        self.rest()
        self.initialised = True

    @errors_for_host
    def do_step(self, current_time: float, step_size: float) -> bool:
        """Go one communication step further; a failure names the time."""
        try:
            self.step(current_time, step_size)
        except (ValueError, ArithmeticError, RecursionError) as problem:
            raise ValueError(f"t = {current_time!r} s: {problem}") from None
        return True

    @errors_for_host
    def get_real(self, vrs: list[int]) -> list[Any]:
        """Return values by reference; before the first step the outputs follow from the parameters."""
        values = self.values
        if not self.initialised and any(self.input_count <= vr < self.first_parameter for vr in vrs):
            self.rest()
        try:
            return [values[vr] for vr in vrs]
        except IndexError:
            raise ValueError(f"found value reference {max(vrs)}, expected 0 to {len(values) - 1}") from None

    get_boolean = get_real

    @errors_for_host
    def set_real(self, vrs: list[int], values: list[Any]) -> None:
        """Set inputs and parameters by reference."""
        inputs = self.input_count
        for vr, value in zip(vrs, values, strict=True):
            if vr >= inputs:
                self.set_parameter(vr, value)
            elif value - value == 0.0:
                self.values[vr] = value
            else:
                raise ValueError(f"{self.table[vr].name}: found {value!r}, expected a finite number")

    set_boolean = set_real

    def set_parameter(self, vr: int, value: float) -> None:
        """Set one parameter where it may be set, to what it may be."""
        if vr >= len(self.table):
            raise ValueError(f"found value reference {vr}, expected 0 to {len(self.table) - 1}")
        row = self.table[vr]
        if row.causality != "parameter":
            raise ValueError(f"{row.name}: cannot be set, it is an {row.causality}")
        if row.variability == "fixed" and self.initialised:
            raise ValueError(f"{row.name}: can only be set before the end of initialisation, it is a fixed parameter")
        if not row.minimum <= value <= row.maximum:
            unit = "" if row.unit == "1" else f" {row.unit}"
            raise ValueError(f"{row.name}: found {value!r}, expected {row.minimum:g} to {row.maximum:g}{unit}")
        self.values[vr] = value
        self.parameters_changed()

    @errors_for_host
    def _get_fmu_state(self) -> dict[str, Any]:
        return {
            "fmu": self.IDENTITY,
            "initialised": self.initialised,
            "start_time_s": self.start_time_s,
            "values": tuple(self.values),
            "memory": self.memory,
        }

    @errors_for_host
    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        if state.get("fmu") != self.IDENTITY:
            raise ValueError(f"found the state of another FMU ({state.get('fmu')}), expected one of {self.IDENTITY}")
        values = state["values"]
        parameters_differ = tuple(self.values[self.first_parameter :]) != values[self.first_parameter :]
        self.values[:] = values
        self.initialised = state["initialised"]
        self.start_time_s = state["start_time_s"]
        if parameters_differ:
            self.parameters_changed()
        self.memory = self.recalled(state["memory"])

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        return json.dumps(state).encode()

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        try:
            return {key: frozen(value) for key, value in json.loads(state).items()}
        except (ValueError, AttributeError):
            return {"fmu": "bytes that are no state"}


def frozen(value: Any) -> Any:
    """Return JSON data with tuples for its arrays, as the kernels keep their states."""
    return tuple(frozen(item) for item in value) if isinstance(value, list) else value


def release_interpreter_once(resources: str | None) -> None:
    """Have PythonFMU's library let go of the interpreter when Python exits, in a Python host on Linux.

    Left alone the library lets go twice while the process exits: of its own accord, and once more in memory that it
    has just freed, which aborts the process now and then. After this call there is nothing left to let go of.
    """
    if resources is None or sys.platform != "linux" or not sys.orig_argv:
        return
    try:
        import ctypes

        for library in (Path(resources).parent / "binaries" / "linux64").glob("*.so"):
            if str(library) not in _LET_GO:
                _LET_GO.add(str(library))
                atexit.register(ctypes.PyDLL(str(library)).finalizePythonInterpreter)
    except (ImportError, OSError, AttributeError):
        return  # no ctypes, or a library that does without: nothing to do


def _hold(held: object) -> None:
    try:
        import ctypes
    except ImportError:
        return  # a host without ctypes: nothing to hold with, the error itself still gets out
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(held))
