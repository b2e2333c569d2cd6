"""Legal call orders of FMI 2.0 with illegal values: every answer is a status with a message, or finite numbers."""

import contextlib
import math
import random
from pathlib import Path
from typing import Any

from fmpy.fmi1 import FMICallException
from fmpy.model_description import ScalarVariable

from bender_loop.errors import RunError
from bender_loop.fmu.file import read_description
from bender_loop.fmu.instance import FmuInstance

VALUES = (
    0.0, -0.0, 1.0, -1.0, 10.0, 49.9, -200.0, 1e-300, 5e-324, 1e9, -1e12, 1e300, -1.7e308, math.inf, -math.inf,
    math.nan,
)  # fmt: skip
STEPS = (0.01, 0.001, 1e-6, 1e-12, 0.3, 5.0, 0.0, -0.01, 1e-300, math.inf, math.nan)
STARTS = (0.0, 5.0, -3.0, 1e6)
_FATAL = 4
_CALLS = 12


def call_cases(fmus: list[Path], cases: int, seed: int) -> list[str]:
    """Go through so many lives of instances, of each FMU in turn; return the complaints."""
    fuzzers = [CallFuzzer(path, random.Random()) for path in fmus]
    for k in range(cases):
        fuzzer = fuzzers[k % len(fuzzers)]
        fuzzer.random = random.Random(f"{seed} calls {k}")
        fuzzer.run(_CALLS)
    for fuzzer in fuzzers:
        fuzzer.close()
    return [text for fuzzer in fuzzers for text in fuzzer.complaints]


class CallFuzzer:
    """One FMU under random calls.

    Attributes:
        complaints: what should not have been, with the calls that led there.
    """

    def __init__(self, path: Path, random_numbers: random.Random) -> None:
        self.path, self.random = path, random_numbers
        self.description = read_description(path)
        variables = self.description.modelVariables
        self.settable = [v for v in variables if v.causality in ("input", "parameter")]
        self.outputs = [int(v.valueReference) for v in variables if v.causality == "output"]
        self.complaints: list[str] = []
        self.instance = FmuInstance(path, self.description)
        self.states: list[Any] = []
        self.trace: list[str] = []

    def run(self, calls: int) -> None:
        """Go through one life of the instance, `calls` calls long at most."""
        self.trace = []
        self._free_states()
        self.instance.reset()
        start_s = self.random.choice(STARTS)
        for _ in range(self.random.randrange(3)):
            self._set()
        if not self._call("initialise", lambda: self.instance.initialise((), start_s)):
            return
        self.time_s = start_s
        for _ in range(self.random.randrange(1, calls + 1)):
            act = self.random.choice((self._set, self._set, self._step, self._step, self._step, self._get, self._state))
            if not act():
                return
        if self.random.random() < 0.3:
            self._call("terminate", self.instance.slave.terminate)

    def close(self) -> None:
        """Free the instance."""
        self._free_states()
        self.instance.close()

    def _set(self) -> bool:
        variable: ScalarVariable = self.random.choice(self.settable)
        reference = [int(variable.valueReference)]
        if variable.type == "Boolean":
            return self._call(f"set {variable.name}", lambda: self.instance.slave.setBoolean(reference, [True]))
        value = self.random.choice(VALUES)
        if self.random.random() < 0.5 and variable.start is not None:
            value = float(variable.start) * self.random.uniform(0.5, 2.0)
        return self._call(f"set {variable.name} = {value!r}", lambda: self.instance.slave.setReal(reference, [value]))

    def _step(self) -> bool:
        step_s = self.random.choice(STEPS) if self.random.random() < 0.3 else self.random.uniform(1e-4, 0.05)
        done = self._call(f"step {step_s!r}", lambda: self.instance.slave.doStep(self.time_s, step_s))
        if done:
            self.time_s += step_s
        return done and self._get()

    def _get(self) -> bool:
        values: list[float] = []
        done = self._call("get", lambda: values.extend(self.instance.slave.getReal(self.outputs)))
        if done and not all(math.isfinite(value) for value in values):
            self._complain(f"gave {values} without an error")
        return done

    def _state(self) -> bool:
        if self.states and self.random.random() < 0.2:
            return self._bytes(self.random.choice(self.states)[1])
        if self.states and self.random.random() < 0.6:
            time_s, state = self.random.choice(self.states)
            self.time_s = time_s
            return self._call("restore", lambda: self.instance.slave.setFMUstate(state))
        kept: list[Any] = []
        done = self._call("save", lambda: kept.append(self.instance.slave.getFMUstate()))
        self.states += [(self.time_s, state) for state in kept]
        return done

    def _bytes(self, state: Any) -> bool:
        """Through bytes and back, of which some were changed on the way."""
        slave, kept = self.instance.slave, []
        if not self._call("serialise", lambda: kept.append(bytes(slave.serializeFMUstate(state)))):
            return False
        data = bytearray(kept[0])
        for _ in range(self.random.choice((0, 1, 5))):
            data[self.random.randrange(len(data))] = self.random.choice(b'0123456789eE-.,[]{}"NaInfty')
        made: list[Any] = []
        done = self._call("deserialise", lambda: made.append(slave.deSerializeFMUstate(bytes(data))))
        self.states += [(self.time_s, other) for other in made]
        return done and (not made or self._call(f"restore {bytes(data)!r}", lambda: slave.setFMUstate(made[0])))

    def _call(self, name: str, call: Any) -> bool:
        """Whether the instance may be used further; an error must come with a message."""
        self.trace.append(name)
        before = self.instance.heard
        try:
            call()
        except (FMICallException, RunError) as problem:
            if self.instance.heard == before:
                self._complain(f"failed without a message ({problem})")
            # FMI allows nothing but a new instance after a fatal status; hosts carry on all the same
            return getattr(problem, "status", _FATAL) < _FATAL or self.random.random() < 0.5
        return True

    def _complain(self, what: str) -> None:
        self.complaints.append(f"{self.path.name}: {what}, after {'; '.join(self.trace[-12:])}")

    def _free_states(self) -> None:
        for _, state in self.states:
            with contextlib.suppress(FMICallException):
                self.instance.slave.freeFMUstate(state)
        self.states = []
