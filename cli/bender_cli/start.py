"""The first thing that `bender` loads: what makes a process ready before anything else is imported.

An interrupt while the rest is still being loaded ends the process in one line. A standard stream that was closed
gets something in its place, so that no file of the command takes its number: what is written to a closed standard
output fails, what is written to a closed standard error goes nowhere. No module is imported from the working folder:
a `statistics.py` that lies there is not the one of Python, here and in every process that is started from here.
"""

import bender_cli.working_folder  # noqa: F401  before whatever else is imported

# isort: split
import io
import os
import signal
import sys
import threading
from typing import NoReturn

INTERRUPTED = 130


def entry() -> NoReturn:
    """Run as a process: `bender` on the command line."""
    _fill_closed_streams()
    from bender_cli.main import entry as run

    run(_take_interrupts)


def _take_interrupts() -> None:
    """From now on Ctrl-C, SIGTERM and the end of a terminal are an exception, which a command can catch.

    Not while modules are loaded: there an exception may come where Python drops it, and the command would go on.
    """
    for number in _ending_signals():
        if signal.getsignal(number) is _leave:
            signal.signal(number, signal.default_int_handler)


def _leave_at_signals() -> None:
    """Let them end the process, unless they are ignored, as under nohup."""
    for number in _ending_signals():
        if signal.getsignal(number) in (signal.default_int_handler, signal.SIG_DFL):
            signal.signal(number, _leave)


def _ending_signals() -> list[int]:
    return [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


def _leave(_number: int, _frame: object) -> NoReturn:
    try:
        os.write(2, b"bender: interrupted\n")
    finally:
        os._exit(INTERRUPTED)


def _fill_closed_streams() -> None:
    for number, name, flags in ((0, "stdin", os.O_RDONLY), (1, "stdout", os.O_RDONLY), (2, "stderr", os.O_WRONLY)):
        if getattr(sys, name) is None:
            _take_number(number, flags)
            mode = "rb" if number == 0 else "wb"
            file = open(number, mode, closefd=False)  # noqa: SIM115
            setattr(sys, name, io.TextIOWrapper(file, encoding="utf-8", errors="replace"))


def _take_number(number: int, flags: int) -> None:
    opened = os.open(os.devnull, flags)
    if opened != number:
        os.dup2(opened, number)
        os.close(opened)


if threading.current_thread() is threading.main_thread():
    _leave_at_signals()
