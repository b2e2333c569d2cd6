"""A first-order lag as an FMU, with the faults that a plant FMU may show."""

import math

from pythonfmu import Boolean, DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real


class LoopTestLag(Fmi2Slave):
    def __init__(self, **settings):
        super().__init__(**settings)
        self.default_experiment = DefaultExperiment(start_time=0.0, stop_time=1.0, step_size=0.01)
        self.u = 5.0
        self.y = 0.0
        self.doubled = 0.0
        self.clock = 0.0
        self.steps = 0
        self.gain = 1e-6
        self.time_constant = 0.1
        self.refuse_above = 1e6
        self.fail_above = 1e6
        self.forgetful = False
        self._memory = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("held", causality=Fmi2Causality.output, getter=lambda: 1e-6 * self.u))
        for name in ("y", "doubled", "clock"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))
        self.register_variable(Integer("steps", causality=Fmi2Causality.output))
        fixed = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}
        for name in ("gain", "time_constant", "refuse_above", "fail_above"):
            self.register_variable(Real(name, **fixed))
        self.register_variable(Boolean("forgetful", **fixed))

    def exit_initialization_mode(self):
        if self.time_constant <= 0.0:
            raise ValueError("time_constant must be > 0")

    def do_step(self, current_time, step_size):
        if self.u > self.fail_above:
            raise ValueError("the input is beyond everything")
        if self.u > self.refuse_above:
            return False
        self._memory += (1.0 - math.exp(-step_size / self.time_constant)) * (self.gain * self.u - self._memory)
        self.y = self._memory
        self.doubled = 2.0 * self.y
        self.clock = current_time
        self.steps += 1
        return True

    def _get_fmu_state(self):
        state = super()._get_fmu_state()
        return state if self.forgetful else {**state, "_memory": self._memory}
