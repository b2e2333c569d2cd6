"""The small protocol that a source of another package is written against, and what the guard makes of it.

A simple source only knows its instrument. That nobody waits for it longer than allowed, that a command is finite, that
an instrument that hangs is opened anew, and the whole way down are the guard's: what a simple source does runs in a
thread of its own, and the guard goes on without it.
"""

import contextlib
import math
import queue
import threading
import time
from collections.abc import Callable, Sequence
from numbers import Real
from typing import Any, Protocol, TypeVar

from bender_hil.supply.failures import BadReplyError, LinkLostError, MismatchError, NoReplyError, SupplyError
from bender_hil.supply.parse import Identity
from bender_hil.supply.patience import SLICE_S, Patience
from bender_hil.supply.same_instrument import SameInstrument
from bender_hil.supply.source import Bounds
from bender_loop.errors import InputError

_T = TypeVar("_T")
_LONGEST_S = 1.0
_LOADING_S = 10.0
"""For a buffer."""
_CLOSING_S = 0.2


class SimpleSource(Protocol):
    """A voltage source as another package writes it. One thread calls it; it may raise whatever goes wrong.

    Attributes:
        lowest_V, highest_V: of its output.
        step_V: smallest change of its output.
        cannot: what it cannot do and somebody might expect, a sentence each.
    """

    lowest_V: float
    highest_V: float
    step_V: float
    cannot: tuple[str, ...]

    def open(self) -> Identity:
        """Open the link and ask who is there; switch nothing."""
        ...

    def switch(self, on: bool) -> None:
        """Switch the output on or off; without a switch, off is 0 V and on is nothing."""
        ...

    def is_on(self) -> bool:
        """Ask the instrument whether its output is on; without a switch, whether it is not at 0 V."""
        ...

    def set_voltage(self, voltage_V: float) -> None:
        """Set the level; return when the command was sent."""
        ...

    def setting_V(self) -> float:
        """Ask the instrument for its level."""
        ...

    def measured_V(self) -> float | None:
        """Measure the output; None where it cannot."""
        ...

    def close(self) -> None:
        """Close the link."""
        ...


class GuardedSimple:
    """A simple source behind the guard's `Source` protocol.

    Args:
        make: makes it, not open yet; anew after each time that it hangs.
        identity: what it said of itself on an earlier link, None where there was none.
        has_switch: whether its output can be switched; off is 0 V where it cannot.
    """

    def __init__(
        self, make: Callable[[], SimpleSource], identity: Identity | None = None, *, has_switch: bool = True
    ) -> None:
        self._make, self._has_switch = make, has_switch
        self._source = make()
        self._same = SameInstrument(identity)
        self._patience = Patience()
        self._worker = _Worker()

    @property
    def patience(self) -> Patience:
        """The deadline of every wait."""
        return self._patience

    @property
    def setting_tolerance_V(self) -> float:
        """One step."""
        return self._source.step_V

    def open(self) -> Identity:
        """Open the link and identify the instrument."""
        identity = self._do(self._source.open)
        if not isinstance(identity, Identity):
            raise BadReplyError(f"the source's open gave {identity!r:.60}, expected an Identity")
        return self._same.check(identity)

    def arm(self, bounds: Bounds) -> list[str]:
        """Output off, 0 V, read back, output on; returns what such an instrument cannot do."""
        source = self._source
        bounds.check(source.lowest_V, source.highest_V, "this source")
        self._do(source.switch, False)
        self._do(source.set_voltage, 0.0)
        if abs(setting_V := self.voltage_setting_V()) > source.step_V:
            raise MismatchError(f"0 V were set, but the source says {setting_V:g} V")
        if self._says_on():
            raise MismatchError("the output was switched off, but the source says that it is on")
        self._do(source.switch, True)
        if self._has_switch and not self._says_on():
            raise MismatchError(
                "the output was switched on, but the source says that it is off; one without a switch has "
                "has_switch = False beside its settings"
            )
        return list(source.cannot)

    def rounded(self, voltage_V: float) -> float:
        """`voltage_V` in steps of the source."""
        step_V = self._source.step_V
        return round(voltage_V / step_V) * step_V if step_V > 0.0 else voltage_V

    def set_voltage(self, voltage_V: float) -> float:
        """Set the level; returns when the command was sent."""
        if not math.isfinite(voltage_V):
            raise ValueError(f"voltage_V must be finite, found {voltage_V!r}")
        return self._do(self._timed, voltage_V)

    def set_voltage_blind(self, voltage_V: float) -> float:
        """Set the level; returns when the command was sent."""
        return self.set_voltage(voltage_V)

    @property
    def has_buffer(self) -> bool:
        """Whether the source plays from a buffer of its own."""
        return hasattr(self._source, "play")

    def play(self, levels_V: Sequence[float], rate_Hz: float) -> float:
        """Let the source play levels by its own clock; returns when the first began."""
        if not self.has_buffer:
            raise ValueError("this source has no buffer")
        return self._do(self._source.play, levels_V, rate_Hz, most_s=_LOADING_S)  # pyright: ignore[reportAttributeAccessIssue]

    def voltage_setting_V(self) -> float:
        """The level as the instrument has it."""
        return _number(self._do(self._source.setting_V), "setting_V")

    def measured_V(self) -> float | None:
        """What is at the output; None where the source cannot measure."""
        measured_V = self._do(self._source.measured_V)
        return None if measured_V is None else _number(measured_V, "measured_V")

    def measured_A(self) -> None:
        """Nothing: a simple source measures no current."""

    def is_on(self) -> bool:
        """Whether the output is switched on; True where there is no switch."""
        return not self._has_switch or self._says_on()

    def confirm_off(self) -> bool:
        """Whether the output is off, by the word of the source itself."""
        return not self._says_on()

    def has_tripped(self) -> bool:
        """False: a simple source has no protection."""
        return False

    def off_blind(self) -> None:
        """Switch the output off."""
        self._do(self._source.switch, False)

    def reconnect(self) -> None:
        """Let go of what hangs, make the source anew and open it; the right instrument has to answer."""
        self.close()
        self._worker = _Worker()
        self._source = self._make()
        self.open()

    def resync(self) -> None:
        """Nothing: `reconnect` has identified it."""

    def release(self) -> None:
        """Nothing: a simple source gives its panel back when it is closed."""

    def close(self) -> None:
        """Close the link; one that hangs is left to itself."""
        with contextlib.suppress(Exception):
            self._worker.run(self._source.close, _CLOSING_S, self._patience.waiting)
        self._worker.end()

    def _says_on(self) -> bool:
        found = self._do(self._source.is_on)
        if found != bool(found):
            raise BadReplyError(f"the source's is_on gave {found!r:.60}, expected True or False")
        return bool(found)

    def _timed(self, voltage_V: float) -> float:
        self._source.set_voltage(voltage_V)
        return time.perf_counter()

    def _do(self, what: Callable[..., _T], *words: object, most_s: float = _LONGEST_S) -> _T:
        # also after the deadline a command gets a moment: what is never sent has no effect at all
        allowed_s = max(SLICE_S, self._patience.left_s(most_s))
        try:
            return self._worker.run(lambda: what(*words), allowed_s, self._patience.waiting)
        except (InputError, SupplyError, ValueError):
            raise
        except Exception as error:  # another's code fails in its own way
            name = getattr(what, "__name__", "it")
            raise LinkLostError(f"the source failed in {name} ({type(error).__name__}: {error})") from error


def _number(found: object, of: str) -> float:
    if not isinstance(found, Real):
        raise BadReplyError(f"the source's {of} gave {found!r:.60}, expected a number")
    return float(found)


class _Worker:
    """A thread that does one thing after the other, and that nobody has to wait for."""

    def __init__(self) -> None:
        self._tasks: queue.SimpleQueue[Any] = queue.SimpleQueue()
        threading.Thread(target=self._serve, name="source", daemon=True).start()
        self._is_stuck = False

    def run(self, what: Callable[[], _T], timeout_s: float, waiting: Callable[[], None]) -> _T:
        """Return what comes of it; NoReplyError when it takes longer, and ever after."""
        if self._is_stuck:
            raise NoReplyError("the source hangs in an earlier call")
        answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._tasks.put((what, answers))
        end_s = time.perf_counter() + timeout_s
        while (left_s := end_s - time.perf_counter()) > 0.0:
            waiting()
            with contextlib.suppress(queue.Empty):
                done, answer = answers.get(timeout=min(left_s, SLICE_S))
                if done:
                    return answer
                raise answer
        self._is_stuck = True
        raise NoReplyError(f"the source did not come back within {timeout_s:.3g} s")

    def end(self) -> None:
        """Let the thread end when it has done what it does."""
        self._tasks.put(None)

    def _serve(self) -> None:
        while (task := self._tasks.get()) is not None:
            what, answers = task
            try:
                answers.put((True, what()))
            except Exception as error:  # handed to whoever asked
                answers.put((False, error))
