"""A static plant with a lag of its own that fails for good after a number of steps."""

import math

from pythonfmu import Fmi2Causality, Fmi2Slave, Real

LIFETIME_STEPS = 20_000
steps_done = [0]


class TiringPlant(Fmi2Slave):
    def __init__(self, **settings):
        super().__init__(**settings)
        self.voltage = 0.0
        self.displacement = 0.0
        self.register_variable(Real("voltage", causality=Fmi2Causality.input))
        self.register_variable(Real("displacement", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        steps_done[0] += 1
        if steps_done[0] > LIFETIME_STEPS:
            raise RuntimeError("the plant is worn out")
        self.displacement += -math.expm1(-step_size / 0.02) * (8e-7 * self.voltage - self.displacement)
        return True
