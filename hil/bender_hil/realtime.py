"""Priority over everything else on the machine, where the operating system grants it."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from bender_loop.errors import InputError

PRIORITY = 20
"""Of SCHED_FIFO, 1 ... 99: above every ordinary process, below the kernel's own threads."""


@contextmanager
def priority(wanted: bool) -> Iterator[None]:
    """Run this thread, and all that it starts meanwhile, before all ordinary ones (Linux, SCHED_FIFO); or do nothing.

    A thread with this priority that never waits would stop the machine; ours wait for frames and messages.

    Raises:
        InputError: the platform has no such thing, or does not permit it.
    """
    if not wanted:
        yield
        return
    if sys.platform != "linux":
        raise InputError("controller.realtime: is for Linux only; set it to false")
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except PermissionError:
        raise InputError(
            "controller.realtime: not permitted; set it to false, or grant CAP_SYS_NICE (ulimit -r, or as root)"
        ) from None
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
