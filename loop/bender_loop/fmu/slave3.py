"""FMI 3.0 co-simulation spoken as FMI 2.0: the calls of `fmpy.fmi2.FMU2Slave` that are used here, over fmpy's FMI 3.0.

Event mode, clocks and early return are not asked for: an FMU then handles its events within its steps, as one of FMI
2.0 does (FMI 3.0, section 4).
"""

from collections.abc import Sequence
from typing import Any

from fmpy import fmi3
from fmpy.fmi1 import FMICallException

from bender_loop.fmu.log import Messages

_ERROR = 3


class Slave3:
    """One FMI 3.0 instance.

    Attributes:
        component: its handle, None before it is made.
        dll: the loaded binary.
    """

    def __init__(self, messages: Messages, **facts: str) -> None:
        # fmpy gives it the functions of the binary by name
        self._slave: Any = fmi3.FMU3Slave(**facts)
        self._messages = messages
        self._start_s = 0.0
        self.dll = self._slave.dll

    @property
    def component(self) -> Any:
        """The handle of the instance."""
        return self._slave.component

    @component.setter
    def component(self, value: Any) -> None:
        self._slave.component = value

    @property
    def setters(self) -> dict[str, Any]:
        """Setters of parameters by the types of FMI 3.0, each with lists of references and values."""
        kinds = ("Float64", "Float32", "Boolean", *(f"{u}Int{bits}" for bits in (8, 16, 32, 64) for u in ("", "U")))
        return {kind: getattr(self._slave, f"set{kind}") for kind in kinds}

    def instantiate(self, visible: bool, callbacks: object, loggingOn: bool) -> None:
        """Make the instance; what it logs goes to the messages that were given."""
        del callbacks
        self._slave.instantiate(visible=visible, loggingOn=loggingOn, logMessage=self._hear)

    def setupExperiment(self, startTime: float = 0.0) -> None:
        """Keep the start time, which FMI 3.0 takes on entering the initialisation."""
        self._start_s = startTime

    def enterInitializationMode(self) -> None:
        """Enter it at the start time."""
        self._slave.enterInitializationMode(startTime=self._start_s)

    def exitInitializationMode(self) -> None:
        """Leave it for step mode."""
        self._slave.exitInitializationMode()

    def setReal(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set variables of type Float64."""
        self._slave.setFloat64(references, values)

    def getReal(self, references: Sequence[int]) -> list[float]:
        """Return variables of type Float64."""
        return list(self._slave.getFloat64(references))

    def doStep(self, time_s: float, step_s: float) -> None:
        """Take a step.

        Raises:
            FMICallException: it fails, or the FMU asks for the end of the simulation.
        """
        _, ends, _, _ = self._slave.doStep(time_s, step_s)
        if ends:
            raise FMICallException(function="fmi3DoStep", status=_ERROR)

    def reset(self) -> None:
        """Back to instantiated."""
        self._slave.reset()

    def getFMUstate(self) -> Any:
        """Return the state."""
        return self._slave.getFMUState()

    def setFMUstate(self, state: Any) -> None:
        """Go back to a state."""
        self._slave.setFMUState(state)

    def freeFMUstate(self, state: Any) -> None:
        """Free a state."""
        self._slave.freeFMUState(state)

    def serializeFMUstate(self, state: Any) -> bytes:
        """Return a state as bytes."""
        return self._slave.serializeFMUState(state)

    def deSerializeFMUstate(self, data: bytes) -> Any:
        """Return the state that bytes hold."""
        return self._slave.deserializeFMUState(data)

    def free(self) -> None:
        """Free the instance."""
        self._slave.fmi3FreeInstance(self._slave.component)

    def freeLibrary(self) -> None:
        """Unload the binary."""
        self._slave.freeLibrary()

    def _hear(self, _environment: object, status: int, _category: bytes, message: bytes | None) -> None:
        self._messages.hear(status, " ".join((message or b"").decode("utf-8", "replace").split()))
