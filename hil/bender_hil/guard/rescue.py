"""A spare guard without a controller, for the watchman."""

from dataclasses import replace

from bender_hil.guard.settings import GuardOrders
from bender_hil.guard.spares import WayDown, start_process
from bender_hil.supply.parse import Identity


def make_safe_alone(line: str, identity: list[str] | None, gone_s: float) -> str:
    """Make safe; returns the alarm, empty where the output is confirmed off.

    Args:
        line: the orders of the guard that has gone.
        identity: what its instrument said of itself.
        gone_s: `time.perf_counter` when the run was lost.
    """
    orders = GuardOrders.from_json(line)
    if identity is not None:
        orders = replace(orders, identity=Identity(*identity))
    way = WayDown(orders, start_process)
    way.due_s = gone_s + orders.limits.shutdown_limit_s
    return way.make_safe(orders).alarm
