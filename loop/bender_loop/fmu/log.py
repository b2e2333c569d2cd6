"""What FMUs log, kept for the instance that logged it.

fmpy's proxy, which formats the variadic messages of C, holds one logger for the whole process: that of whichever
instance came last, even when that one is long gone. So there is one logger here that stays for good and tells the
instances apart by their environment.
"""

import ctypes
import itertools
import weakref
from collections import deque
from typing import Any

import fmpy
from fmpy import fmi2
from fmpy.logging import addLoggerProxy

_KEPT = 50
_numbers = itertools.count(1)


class Messages(deque[tuple[int, str]]):
    """The last (status, text) that one instance logged.

    Attributes:
        heard: how many there were in all.
    """

    def __init__(self) -> None:
        super().__init__(maxlen=_KEPT)
        self.heard = 0

    def hear(self, status: int, text: str) -> None:
        """Take one more message."""
        self.append((status, text))
        self.heard += 1


_logs: weakref.WeakValueDictionary[int, Messages] = weakref.WeakValueDictionary()


def _log(environment: int | None, _instance: bytes, status: int, _category: bytes, message: bytes | None) -> None:
    text = " ".join((message or b"").decode("utf-8", "replace").split())
    log = _logs.get(environment or 0)
    # an FMU that does not hand its environment on is heard by everyone
    for heard in list(_logs.values()) if log is None else (log,):
        heard.hear(status, text)


_LOGGER = fmi2.fmi2CallbackLoggerTYPE(_log)


def callbacks_for(messages: Messages) -> fmi2.fmi2CallbackFunctions:
    """The callbacks of an instance whose messages go to `messages`, as long as somebody holds them."""
    number = next(_numbers)
    _logs[number] = messages
    callbacks = _with_logger()
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    callbacks.componentEnvironment = number
    return callbacks


def take_the_log() -> None:
    """Have messages come here again, whoever has used fmpy's proxy in the meantime."""
    _with_logger()


def _with_logger() -> Any:
    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = _LOGGER
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks
