"""A first-order lag with one fault, which `resources/fault.txt` names."""

import atexit
import math
import os
import time
from pathlib import Path

from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

_left = {"y": 0.0}


class LoopTestFaulty(Fmi2Slave):
    def __init__(self, **settings):
        super().__init__(**settings)
        self.default_experiment = DefaultExperiment(start_time=0.0, stop_time=1.0, step_size=0.01)
        told = Path(settings.get("resources") or ".", "fault.txt")
        self.fault = told.read_text(encoding="utf-8") if told.is_file() else ""
        if self.fault == "no package":
            import a_package_that_nobody_has  # noqa: F401 # pyright: ignore[reportMissingImports]
        if self.fault == "aborts at the end":
            atexit.register(os.abort)
        self.u = 0.0
        self.y = 0.0
        self._hidden = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input, variability=Fmi2Variability.continuous))
        self.register_variable(Real("y", causality=Fmi2Causality.output, variability=Fmi2Variability.continuous))

    def setup_experiment(self, start_time, stop_time, tolerance):
        if self.fault == "starts at zero only" and start_time != 0.0:
            raise ValueError("the start time must be 0")

    def do_step(self, current_time, step_size):
        if self.fault == "crash":
            os.abort()
        if self.fault == "leaves":
            os._exit(0)
        if self.fault == "hang":
            time.sleep(60.0)
        if not math.isfinite(self.u) and self.fault != "lets nan through":
            raise ValueError("u is not finite")
        share = step_size / 0.1 if self.fault == "coarse" else -math.expm1(-step_size / 0.1)
        self._hidden += share * (self.u - self._hidden)
        if self.fault in ("left over", "shared"):
            _left["y"] = _left["y"] * 0.5 + self._hidden
            self._hidden = _left["y"]
        self.y = math.nan if self.fault == "nan" else self._hidden
        return True

    def _get_fmu_state(self):
        state = {"u": self.u, "y": self.y}
        return state if self.fault == "forgetful" else {**state, "_hidden": self._hidden}

    def _set_fmu_state(self, state):
        for name, value in state.items():
            setattr(self, name, value)
