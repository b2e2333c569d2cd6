"""Machine code that is read from disk without what only compiling needs.

Before numba reads a compiled function it declares to itself all that Python and NumPy offer to compiled code, which
takes longer than reading it. Code that is on disk needs only the runtime that counts who holds an array.
"""

import contextlib
from types import ModuleType
from typing import Any

import numba
from numba.core.caching import FunctionCache
from numba.core.runtime.nrt import rtsys

KNOWN = (0, 68)
"""The version of numba whose code is read so; what reading needs is private, and another one may need more."""


class StoredCode(FunctionCache):
    """The cache of a compiled function; what it lacks is compiled, and declared first, as ever."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the machine code of a signature, None where it is not on disk, or not whole."""
        try:
            if numba.version_info.short != KNOWN:
                return super().load_overload(sig, target_context)
            rtsys.initialize(target_context)
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
        except Exception:
            # a damaged file fails in any way; what is compiled next is written in its place
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write machine code where there is room for it; without it on disk, the next process compiles again."""
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)


def use_stored_code(module: ModuleType) -> None:
    """Have the functions of a module that keep their machine code read and write it in this way."""
    for function in vars(module).values():
        if type(getattr(function, "_cache", None)) is FunctionCache:
            function._cache = StoredCode(function.py_func)
