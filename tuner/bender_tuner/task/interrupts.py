"""Ctrl-C, SIGTERM and SIGHUP that wait until no FMU call is running.

An exception raised inside the Python of an FMU can bring its binary down with the whole process. While the guard is
on, a signal therefore only sets a flag, and `GuardedPlant` raises KeyboardInterrupt between two calls of the plant. A
second signal while the first one still waits acts at once: the plant may hang.
"""

import signal
import threading
from collections.abc import Callable, Mapping
from types import FrameType, TracebackType
from typing import Any, NoReturn, Protocol, Self

from bender_loop.control.plant import Readable
from bender_loop.errors import RunError
from bender_loop.fmu.elsewhere import RunThere, run_there_of
from bender_tuner.model.monte_carlo import ParameterisedPlant

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class ReadablePlant(ParameterisedPlant, Readable, Protocol):
    """A plant that can be read and whose parameters can be set by name."""


class DeferredInterrupts:
    """Context that turns SIGINT, SIGTERM and SIGHUP into a flag; outside the main thread it changes nothing.

    Attributes:
        pending: a signal came and `check` has not been called since.
    """

    def __init__(self) -> None:
        self.pending = False
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            # A signal that is ignored, as under nohup, stays ignored.
            heeded = [number for number in _SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
            self._before = {number: signal.signal(number, self._note) for number in heeded}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            # None stands for a handler that was not installed from Python and cannot be put back.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        self._before = {}
        if kind is None:
            self.check()

    def check(self) -> None:
        """Raise the KeyboardInterrupt that is pending, if there is one."""
        if self.pending:
            self.pending = False
            raise KeyboardInterrupt

    def _note(self, _number: int, _frame: FrameType | None) -> None:
        if self.pending:
            raise KeyboardInterrupt
        self.pending = True


class ClosedPlant:
    """What a pickle has in the place of a plant: its FMU ran in the process that made the pickle."""

    def _closed(self, *_: object) -> NoReturn:
        raise RunError("the FMU of this tuning is closed: it came out of a pickle; tune again to run it")

    set_parameters = reset = step = read = _closed

    def close(self) -> None:
        """Do nothing: there is nothing open."""


class GuardedPlant:
    """`plant`, with pending interrupts raised before each of its calls and none raised within.

    Attributes:
        interrupts: what is asked whether one is pending; plants of one tuning share it.
    """

    def __init__(self, plant: ReadablePlant, interrupts: DeferredInterrupts) -> None:
        self._plant = plant
        self._step = plant.step
        self.interrupts = interrupts

    def __reduce__(self) -> tuple[Any, ...]:
        return ClosedPlant, ()

    def set_parameters(self, parameters: Mapping[str, float], /) -> None:
        """Set parameters of the plant."""
        self.interrupts.check()
        self._plant.set_parameters(parameters)

    def reset(self) -> None:
        """Reset the plant."""
        self.interrupts.check()
        self._plant.reset()

    def step(self, voltage_V: float, step_s: float) -> float:
        """Advance the plant; returns displacement_um."""
        if self.interrupts.pending:
            self.interrupts.check()
        return self._step(voltage_V, step_s)

    @property
    def run_there(self) -> RunThere | None:
        """How whole functions are run where the plant lives, None where that is here."""
        there = run_there_of(self._plant)
        if there is None:
            return None

        def guarded(function: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
            self.interrupts.check()
            try:
                return there(function, args, kwargs)
            except RunError:  # the plant may have been stopped for the interrupt's sake
                self.interrupts.check()
                raise

        return guarded

    def read(self) -> float:
        """The displacement_um now."""
        return self._plant.read()

    def close(self) -> None:
        """Close the plant."""
        self._plant.close()
