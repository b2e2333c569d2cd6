"""Close a loop around the actuator: the FMU as the plant, the PID block as the controller, a 10 um step."""

from bender_export.build import ensure_plant_fmu
from bender_loop.control.closed_loop import Sampling, simulate
from bender_loop.control.metrics import step_metrics
from bender_loop.control.pid import Gains, Limits
from bender_loop.control.references import Step
from bender_loop.fmu.plant import FmuPlant

with FmuPlant(ensure_plant_fmu("bench")) as plant:
    trace = simulate(
        plant,
        Gains(proportional_V_per_um=0.0, integral_V_per_um_s=5.0),
        Limits(lower_V=0.0, upper_V=50.0),
        Step(level_um=10.0),
        Sampling(rate_Hz=30.0, latency_frames=1),
        duration_s=2.0,
    )
figures = step_metrics(trace)
print(f"rise {figures.rise_time_s:.3f} s, settling {figures.settling_time_s:.3f} s")
print(f"overshoot {figures.overshoot_percent:.2f} %, last voltage {trace.voltage_V[-1]:.2f} V")
