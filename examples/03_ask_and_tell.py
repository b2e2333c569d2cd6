"""Tune the gains by hand-driven beetle antennae search: the optimiser asks, the FMU answers, the optimiser is told."""

import numpy as np

from bender_export.build import ensure_plant_fmu
from bender_loop.control.closed_loop import Sampling
from bender_loop.control.pid import Gains, Limits
from bender_loop.fmu.plant import FmuPlant
from bender_tuner.optimisers import create
from bender_tuner.task.experiment import StepExperiment
from bender_tuner.task.objectives import at_point, mean_squared_error
from bender_tuner.task.search_space import SearchSpace

space = SearchSpace(Gains(0.2, 5.0, 0.005, filter_time_s=2.0 / 30.0))
with FmuPlant(ensure_plant_fmu("bench")) as plant:
    sampling = Sampling(rate_Hz=30.0, latency_frames=1)
    experiment = StepExperiment(plant, Limits(0.0, 50.0), setpoint_um=10.0, sampling=sampling, duration_s=2.0)
    objective = mean_squared_error(experiment)
    beetle = create("reliable_bas", 3, np.random.default_rng(1), budget=61)
    for _ in range(61):
        point = beetle.ask()
        beetle.tell(point, at_point(objective, space, point))
    beetle.close()
best = space.to_gains(beetle.best_x)
print(f"mean squared error {beetle.best_f:.4f} µm² after {beetle.evaluations} evaluations")
print(f"Kp {best.proportional_V_per_um:.4g}, Ki {best.integral_V_per_um_s:.4g}, Kd {best.derivative_V_s_per_um:.4g}")
