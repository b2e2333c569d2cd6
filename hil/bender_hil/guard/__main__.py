"""`python -m bender_hil.guard`: the guard as a process of its own.

Reads its orders as one line from the standard input and calls the controller that it is told of. It outlives the
controller for as long as the way down takes. A guard that is ordered to make safe does nothing else: it switches the
output off before it opens a journal or calls anybody.

A signal that would end it (SIGTERM, SIGHUP, SIGINT, SIGQUIT; SIGBREAK on Windows) brings the output down like any
other end; a second one is not faster. Those of a terminal that would stop it are ignored.
"""

import contextlib
import gc
import math
import signal
import sys
import time
from pathlib import Path
from typing import Any

from bender_hil.guard.descent import descend
from bender_hil.guard.guard import ALIVE_S, Guard, Status, say_end
from bender_hil.guard.settings import GuardOrders
from bender_hil.guard.stop_ear import StopEar
from bender_hil.log.journal import GuardJournal
from bender_hil.realtime import priority
from bender_hil.supply.source import Source
from bender_loop.errors import InputError
from bender_loop.shell.messages import Channel, ClosedError, call

_ENDING = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGBREAK", "SIGUSR1", "SIGUSR2", "SIGALRM")
_IGNORED = ("SIGTSTP", "SIGTTIN", "SIGTTOU", "SIGPIPE")
_RESCUES = 9


class NoJournal(GuardJournal):
    """Keeps nothing: where nothing can be written, switching off goes on all the same."""

    def __init__(self) -> None:
        """Open nothing."""

    def write(self, kind: str, **facts: Any) -> None:
        """Drop the entry."""

    def sync(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


def main() -> int:
    """Guard one run; returns the guard's exit status, which nobody has to believe: what counts is said."""
    received: list[str] = []
    guard: Guard | None = None

    def take(number: int, _: object) -> None:
        received.append(signal.Signals(number).name)
        if guard is not None:
            guard.signal = received[-1]

    for names, handler in ((_ENDING, take), (_IGNORED, signal.SIG_IGN)):
        for name in names:
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), handler)
    line = sys.stdin.readline()
    if not line.endswith("\n"):
        # whoever started this process was lost before it could say what for
        return Status.REFUSED
    orders = GuardOrders.from_json(line)
    # what it needs is loaded before anybody counts how long it is silent
    source = orders.make_source()
    if orders.make_safe:
        return make_safe(orders, source)
    try:
        channel = call(orders.port or 0, orders.password)
    except ClosedError:
        return Status.TRIPPED
    try:
        journal = GuardJournal(Path(orders.journal))
    except InputError as error:
        channel.send({"say": "refused", "status": int(Status.REFUSED), "sentence": str(error)})
        return Status.REFUSED
    watchman = _watchman(orders)
    guard = Guard(source, orders.limits, channel, journal, _ear(orders), watchman)
    guard.signal = received[-1] if received else None
    # a collection in the middle of the run would cost milliseconds, and nothing here makes cycles
    gc.collect()
    gc.freeze()
    gc.disable()
    with priority(orders.realtime):
        return guard.run()


def _ear(orders: GuardOrders) -> StopEar | None:
    """Return the ear for STOP; a machine that gives no socket is no reason not to guard."""
    if not orders.stop_token:
        return None
    try:
        return StopEar(orders.stop_token)
    except (OSError, ValueError):
        return None


def _watchman(orders: GuardOrders) -> Channel | None:
    """Return the channel to the watchman; the loss of that one alone ends no run."""
    try:
        return None if orders.watch_port is None else call(orders.watch_port, orders.watch_password)
    except ClosedError:
        return None


def make_safe(orders: GuardOrders, source: Source) -> int:
    """For when the guard of a run was lost: switch off, then find out whether it is off, and say so."""
    with contextlib.suppress(Exception):
        source.reconnect()
        source.off_blind()
    channel, watchman = _reached(orders), _watchman(orders)
    journal = _rescue_journal(Path(orders.journal))

    def tell(what: str, **facts: Any) -> None:
        for listener in (channel, watchman):
            if listener is not None:
                with contextlib.suppress(Exception):
                    listener.send({"say": what, **facts})

    said_s = -math.inf

    def say_alive() -> None:
        nonlocal said_s
        if time.perf_counter() - said_s > ALIVE_S:
            said_s = time.perf_counter()
            tell("alive")

    source.patience.waiting = say_alive
    landing = descend(source, orders.limits, 0.0, journal, tell)
    source.close()
    status = Status.TRIPPED if landing.confirmed else Status.UNCONFIRMED
    if watchman is not None:
        with contextlib.suppress(ClosedError):
            watchman.send({"say": "end", "confirmed": landing.confirmed})
    say_end(channel, journal, status, landing, code="guard_gone", sentence="the guard has gone; another one made safe")
    return status


def _reached(orders: GuardOrders) -> Channel | None:
    if orders.port is None:
        return None
    try:
        return call(orders.port, orders.password)
    except ClosedError:
        return None


def _rescue_journal(first: Path) -> GuardJournal:
    """A journal beside that of the lost guard, under a free name; else one that keeps nothing."""
    for path in (first, *(first.with_stem(f"{first.stem}-{number}") for number in range(2, _RESCUES + 1))):
        with contextlib.suppress(Exception):
            return GuardJournal(path)
    return NoJournal()


if __name__ == "__main__":
    sys.exit(main())
