"""Signals that ask for the end: before the supply is armed they end the run at once, afterwards they are remembered.

Once the output is on there is one way out, the guard's way down; a signal only asks the loop to take it.
"""

import contextlib
import signal
import threading
from types import FrameType, TracebackType
from typing import Self

ENDING_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGBREAK")


class Interrupted(KeyboardInterrupt):  # it is no error, and what catches Ctrl-C has to catch it
    """Somebody asked for the end before anything was switched on; the message is the signal's name."""


class Interrupts:
    """Takes the signals while its context lasts; only in the main thread, elsewhere it does nothing.

    SIGHUP stays ignored where it was, as under `nohup`.

    Attributes:
        signal: name of the last signal that came, None for none.
    """

    def __init__(self) -> None:
        self.signal: str | None = None
        self._is_deferred = False
        self._before: dict[signal.Signals, object] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for name in ENDING_SIGNALS:
                number = getattr(signal, name, None)
                if number is not None and not (name == "SIGHUP" and signal.getsignal(number) == signal.SIG_IGN):
                    self._before[number] = signal.signal(number, self._take)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            with contextlib.suppress(TypeError):
                signal.signal(number, handler)  # pyright: ignore[reportArgumentType]
        self._before.clear()

    def defer(self) -> None:
        """From now on a signal is remembered and nothing else; one that came already interrupts now.

        Raises:
            Interrupted: it came where an exception goes unheard, as in a destructor.
        """
        self._is_deferred = True
        if self.signal is not None:
            raise Interrupted(self.signal)

    def _take(self, number: int, _: FrameType | None) -> None:
        self.signal = signal.Signals(number).name
        if not self._is_deferred:
            raise Interrupted(self.signal)
