"""A compiled model over the C functions of FMI 2.0, called with ctypes: quick enough for many steps."""

import ctypes
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pytest

from bender_native.build import Way, source_files
from bender_native.compilers import compiled, has_zig, own_compiler, own_platform
from bender_native.model_source import Source
from bender_native.plant_source import plant_source
from bender_plant.model import Model

needs_own_compiler = pytest.mark.skipif(
    own_platform() is None or (own_compiler() is None and not has_zig()), reason="no C compiler is installed"
)
GUID = "{tested}"


def own_way(fmi: int) -> Way:
    """The way to build an FMU of this version for this machine alone."""
    own = own_platform()
    assert own is not None
    return Way(fmi, (own,))


_CALLBACKS = ctypes.c_void_p * 5


def library_of(source: Source, slopes: Source, own: bool = True) -> bytes:
    """Compile a model with the layer of FMI 2.0, with the machine's `own` compiler where there is one."""
    target = own_platform()
    assert target is not None
    identity = f'#define MODEL_GUID "{GUID}"\n#define MODEL_IDENTITY "tested {GUID}"\n'
    return compiled(source_files(source, slopes, 2) | {"identity.h": identity.encode()}, "tested", target, own=own)


class Library:
    """A loaded library; its instances share it."""

    def __init__(self, source: Source, slopes: Source, own: bool = True) -> None:
        self.source = source
        self.references = {row.name: k for k, row in enumerate(source.table)}
        folder = tempfile.mkdtemp(prefix="native_tested_")
        path = Path(folder) / "tested.so"
        path.write_bytes(library_of(source, slopes, own))
        self.calls = ctypes.CDLL(str(path))
        shutil.rmtree(folder, ignore_errors=True)
        self.calls.fmi2Instantiate.restype = ctypes.c_void_p

    def call(self, name: str, *arguments: Any) -> int:
        return getattr(self.calls, name)(*arguments)


def plant_library(model: Model, own: bool = True) -> Library:
    return Library(plant_source(model), plant_source(model, dual=True), own)


class Running:
    """One instance, initialised."""

    def __init__(self, library: Library, parameters: Mapping[str, float] | None = None, start_s: float = 0.0) -> None:
        self.library = library
        callbacks = _CALLBACKS()
        handle = library.calls.fmi2Instantiate(
            b"tested", ctypes.c_int(1), GUID.encode(), b"", ctypes.byref(callbacks), ctypes.c_int(0), ctypes.c_int(0)
        )
        assert handle is not None
        self.handle = ctypes.c_void_p(handle)
        self.must("fmi2SetupExperiment", 0, ctypes.c_double(0.0), ctypes.c_double(start_s), 0, ctypes.c_double(0.0))
        self.must("fmi2EnterInitializationMode")
        self.set(parameters or {})
        self.must("fmi2ExitInitializationMode")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.library.calls.fmi2FreeInstance(self.handle)

    def must(self, name: str, *arguments: Any) -> None:
        assert self.library.call(name, self.handle, *arguments) == 0, name

    def set(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            vr = ctypes.c_uint(self.library.references[name])
            self.must("fmi2SetReal", ctypes.byref(vr), ctypes.c_size_t(1), ctypes.byref(ctypes.c_double(value)))

    def get(self, *names: str) -> list[float]:
        vrs = (ctypes.c_uint * len(names))(*[self.library.references[name] for name in names])
        values = (ctypes.c_double * len(names))()
        self.must("fmi2GetReal", vrs, ctypes.c_size_t(len(names)), values)
        return list(values)

    def step(self, voltage_V: float, time_s: float, step_s: float) -> list[float] | None:
        """Return reading and tip in m, None where the step failed."""
        self.set({"voltage": voltage_V})
        arguments = (ctypes.c_double(time_s), ctypes.c_double(step_s), ctypes.c_int(0))
        if self.library.call("fmi2DoStep", self.handle, *arguments):
            return None
        return self.get("displacement", "tip_displacement")

    def saved(self) -> ctypes.c_void_p:
        state = ctypes.c_void_p()
        self.must("fmi2GetFMUstate", ctypes.byref(state))
        return state

    def restore(self, state: ctypes.c_void_p) -> None:
        self.must("fmi2SetFMUstate", state)
        self.must("fmi2FreeFMUstate", ctypes.byref(state))

    def serialised(self) -> bytes:
        state, size = self.saved(), ctypes.c_size_t()
        self.must("fmi2SerializedFMUstateSize", state, ctypes.byref(size))
        data = (ctypes.c_char * size.value)()
        self.must("fmi2SerializeFMUstate", state, data, size)
        self.must("fmi2FreeFMUstate", ctypes.byref(state))
        return data.raw

    def deserialise(self, data: bytes) -> None:
        state = ctypes.c_void_p()
        self.must("fmi2DeSerializeFMUstate", data, ctypes.c_size_t(len(data)), ctypes.byref(state))
        self.restore(state)

    def slopes(self, unknowns: list[str], known: str) -> list[float]:
        vrs = (ctypes.c_uint * len(unknowns))(*[self.library.references[name] for name in unknowns])
        by = ctypes.c_uint(self.library.references[known])
        found = (ctypes.c_double * len(unknowns))()
        seed = ctypes.c_double(1.0)
        count, one = ctypes.c_size_t(len(unknowns)), ctypes.c_size_t(1)
        self.must("fmi2GetDirectionalDerivative", vrs, count, ctypes.byref(by), one, ctypes.byref(seed), found)
        return list(found)
