"""`python -m bender_hil.guard`: the guard as a process of its own.

Reads its orders as one line from the standard input and calls the controller that it is told of. It outlives the
controller for as long as the way down takes. Without a controller it does nothing but make safe.

SIGINT, SIGTERM, SIGHUP (SIGBREAK on Windows) bring the output down like any other end; a second one is not faster.
"""

import gc
import signal
import sys
from pathlib import Path

from bender_hil.guard.descent import descend
from bender_hil.guard.guard import Guard, Status
from bender_hil.guard.settings import GuardOrders
from bender_hil.log.journal import GuardJournal
from bender_hil.realtime import priority
from bender_hil.supply.failures import SupplyError
from bender_hil.supply.select import make_source
from bender_hil.wire import ClosedError, call

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")


def main() -> int:
    """Guard one run; returns the guard's exit status."""
    received: list[str] = []
    guard: Guard | None = None

    def take(number: int, _: object) -> None:
        received.append(signal.Signals(number).name)
        if guard is not None:
            guard.signal = received[-1]

    for name in _SIGNALS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), take)
    orders = GuardOrders.from_json(sys.stdin.readline())
    journal = GuardJournal(Path(orders.journal))
    if orders.port is None:
        return _make_safe(orders, journal)
    try:
        channel = call(orders.port, orders.password)
    except ClosedError as error:
        journal.write("refused", sentence=f"the controller cannot be reached: {error}")
        return Status.TRIPPED
    guard = Guard(make_source(orders.supply), orders.limits, channel, journal)
    guard.signal = received[-1] if received else None
    # a collection in the middle of the run would cost milliseconds, and nothing here makes cycles
    gc.collect()
    gc.freeze()
    gc.disable()
    with priority(orders.realtime):
        return guard.run()


def _make_safe(orders: GuardOrders, journal: GuardJournal) -> int:
    """For when the guard of a run was lost: find the supply, switch it off, verify."""
    source = make_source(orders.supply)
    try:
        source.open()
    except SupplyError as error:
        journal.write("not_confirmed", sentence=str(error))
    landing = descend(source, orders.limits, 0.0, journal)
    source.close()
    journal.write("end", confirmed=landing.confirmed, off_s=landing.off_s, harmless_s=landing.harmless_s)
    return Status.TRIPPED if landing.confirmed else Status.UNCONFIRMED


if __name__ == "__main__":
    sys.exit(main())
