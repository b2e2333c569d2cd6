"""Independent simulations side by side in threads: compiled kernels leave the interpreter free for one another.

The results are those of one after the other, in the same order, however many threads there are.
"""

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

THREADS = "BENDER_THREADS"
"""The environment variable with the number of threads; 1 is none beside the main one."""
MOST_THREADS = 8
"""More wait for the interpreter between two kernels."""


def parallel_map(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return `function` of every item, computed side by side where cores are free.

    Within a thread that this function has begun, and outside of the main thread, items are computed one by one.
    """
    listed = list(items)
    threads = min(cores(), len(listed))
    if threads < 2 or threading.current_thread() is not threading.main_thread():
        return [function(x) for x in listed]
    return list(_pool().map(function, listed))


def cores() -> int:
    """Return how many simulations, or processes beside this one, may run at a time."""
    told = os.environ.get(THREADS, "")
    if told.isdecimal() and int(told) > 0:
        return min(int(told), MOST_THREADS)
    free = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(free, MOST_THREADS)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(MOST_THREADS if os.environ.get(THREADS) else cores(), "bender-simulation")


# threads do not live on in a forked process, which begins its own
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)
