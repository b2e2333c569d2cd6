"""An FMU over FMPy's low-level calls; as a script, several FMUs side by side in a process of their own.

The script reads `{"fmus": [path, ...], "steps": [[voltage_V, step_s], ...]}` from standard input, loads every FMU
before it steps any, and writes the outputs of each as JSON, which keeps every bit of a double.
"""

import json
import shutil
import sys
from collections.abc import Mapping
from ctypes import byref
from pathlib import Path
from typing import Any, Self

from fmpy import calloc, extract, free, read_model_description
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)


class RunningFmu:
    """One instance; `messages` and `categories` collect what it logs."""

    def __init__(
        self, path: Path, parameters: Mapping[str, float] | None = None, start_s: float = 0.0, ready: bool = True
    ) -> None:
        description = read_model_description(str(path))
        if description.coSimulation is None:
            raise ValueError(f"{path}: found no co-simulation, expected one")
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.outputs = [v.name for v in description.modelVariables if v.causality == "output"]
        self.folder = extract(path)
        self.messages: list[str] = []
        self.categories: list[str] = []
        self.slave: Any = FMU2Slave(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="tested",
        )
        self.slave.instantiate(callbacks=self._callbacks(), loggingOn=True)
        if ready:
            self.begin(parameters or {}, start_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.slave.terminate()
        self.slave.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)

    def begin(self, parameters: Mapping[str, float], start_s: float = 0.0) -> None:
        self.set(parameters)
        self.time_s = start_s
        self.slave.setupExperiment(startTime=start_s)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def set(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            variable = self.variables[name]
            setter = self.slave.setBoolean if variable.type == "Boolean" else self.slave.setReal
            setter([variable.valueReference], [value])

    def get(self, *names: str) -> list[float]:
        return self.slave.getReal([self.variables[name].valueReference for name in names])

    def step(self, step_s: float, **inputs: float) -> list[float]:
        self.set(inputs)
        self.slave.doStep(self.time_s, step_s)
        self.time_s += step_s
        return self.get(*self.outputs)

    def saved(self) -> bytes:
        state = self.slave.getFMUState()
        data = self.slave.serializeFMUstate(state)
        self.slave.freeFMUState(state)
        return bytes(data)

    def restore(self, data: bytes) -> None:
        state = self.slave.deSerializeFMUstate(data)
        self.slave.setFMUstate(state)
        self.slave.fmi2FreeFMUstate(self.slave.component, byref(state))

    def _callbacks(self) -> Any:
        def log(_environment: Any, _instance: Any, _status: int, category: bytes | None, message: bytes) -> None:
            self.messages.append(message.decode())
            self.categories.append((category or b"").decode())

        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(log)
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        return callbacks


def main() -> None:
    job = json.load(sys.stdin)
    running = [RunningFmu(Path(path)) for path in job["fmus"]]
    outputs = [[fmu.step(step_s, voltage=voltage_V) for fmu in running] for voltage_V, step_s in job["steps"]]
    for fmu in running:
        fmu.__exit__()
    json.dump(list(zip(*outputs, strict=True)), sys.stdout)


if __name__ == "__main__":
    main()
