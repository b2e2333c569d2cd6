"""An oven of two stores as an FMU without units: heated air, and a load in it."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

SUB_STEP_S = 0.1


class DiscrepancyTestOven(Fmi2Slave):
    def __init__(self, **settings):
        super().__init__(**settings)
        self.power, self.ambient = 0.0, 293.15
        self.air = self.load = 293.15
        self.R, self.R_load, self.C, self.C_load = 0.5, 0.25, 120.0, 260.0
        for name in ("power", "ambient"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in ("air", "load"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))
        tunable = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.tunable}
        for name in ("R", "R_load", "C", "C_load"):
            self.register_variable(Real(name, **tunable))

    def exit_initialization_mode(self):
        self.air = self.load = self.ambient

    def do_step(self, current_time, step_size):
        count = max(1, round(step_size / SUB_STEP_S))
        h = step_size / count
        for _ in range(count):
            flow = (self.air - self.load) / self.R_load
            warming = (self.power - flow - (self.air - self.ambient) / self.R) / self.C
            self.air, self.load = self.air + h * warming, self.load + h * flow / self.C_load
        return True
