"""Pickles of what holds functions that were made inside of functions, as the forms of effects do.

Such a function goes along as its code, its defaults and what it closes over, and is put together again in the module
that it came from. The bytes are for the same version of Python and of this package.
"""

import importlib
import io
import marshal
import pickle
from types import CellType, FunctionType
from typing import Any


def pickle_with_closures(value: Any) -> bytes:
    """Return the pickle of a value."""
    buffer = io.BytesIO()
    _Pickler(buffer, pickle.HIGHEST_PROTOCOL).dump(value)
    return buffer.getvalue()


class _Pickler(pickle.Pickler):
    def reducer_override(self, obj: Any) -> Any:
        if not isinstance(obj, FunctionType) or "<" not in obj.__qualname__:
            return NotImplemented
        closed = tuple(cell.cell_contents for cell in obj.__closure__ or ())
        more = (obj.__name__, obj.__qualname__, obj.__defaults__, obj.__kwdefaults__)
        return _function, (obj.__module__, marshal.dumps(obj.__code__), closed, *more)


def _function(
    module: str,
    code: bytes,
    closed: tuple[Any, ...],
    name: str,
    qualified: str,
    defaults: tuple[Any, ...] | None,
    named_defaults: dict[str, Any] | None,
) -> FunctionType:
    found = importlib.import_module(module).__dict__
    function = FunctionType(marshal.loads(code), found, name, defaults, tuple(CellType(x) for x in closed))
    function.__qualname__, function.__kwdefaults__ = qualified, named_defaults
    return function
