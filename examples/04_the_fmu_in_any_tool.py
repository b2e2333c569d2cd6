"""The FMU needs nothing of this project at run time: here FMPy alone steps it, 0.1 s at 20 V, then at rest."""

import fmpy
import numpy as np

from bender_export.build import ensure_plant_fmu

path = str(ensure_plant_fmu("paper"))
signal = np.array([(0.0, 20.0), (0.1, 20.0), (0.1, 0.0), (0.3, 0.0)], dtype=[("time", float), ("voltage", float)])
result = fmpy.simulate_fmu(
    path,
    input=signal,
    output=["displacement"],
    output_interval=0.01,
    stop_time=0.3,
    start_values={"calibration.gain": 0.5},
)
for row in result[::5]:
    print(f"{row['time']:.2f} s  {1e6 * row['displacement']:8.3f} µm")
