"""What stays at 0 V after the voltage was up and down again: the mark that parts hysteresis from relaxation."""

import math

import numpy as np

from bender_compiled.simulation import Bounds, Drive, Simulator
from bender_identify.fitting.resimulation import quasi_static
from bender_plant.model import Model
from bender_plant.plant import sub_step_bounds_s

ROWS = 200
WAIT_ROWS, LONGEST_WAIT_STEP_S = 2000, 50.0
WAIT_STEP = 100.0
"""One row of the wait in units of the model's own longest sub-step, some three of its shortest time constants."""
LEAST_PART = 1e-3
"""Less than this part of the stroke is no remanence."""
MOST_PART = 2.0
"""More than this part of what the ramp moved was not left by the ramp: the model drifts away at rest."""


def remanence_um(model: Model, peak_V: float, ramp_s: float) -> tuple[float, bool]:
    """Return the displacement left long after a ramp to `peak_V` and back, and whether it counts as remanence.

    The model runs without its structure. Creep with time constants beyond the wait would be taken for remanence. A
    model that runs away while the voltage rests has infinite remanence.

    Args:
        model: any model.
        peak_V: where the ramp turns.
        ramp_s: duration of one ramp.
    """
    ramp = np.linspace(0.0, 1.0, ROWS)
    still = quasi_static(model)
    step_s = min(LONGEST_WAIT_STEP_S, WAIT_STEP * sub_step_bounds_s(still)[1])
    waits = step_s * np.arange(1.0, WAIT_ROWS)
    path = peak_V * np.concatenate([ramp, ramp[-2::-1], np.zeros(len(waits))])
    time_s = np.concatenate([ramp_s * ramp, ramp_s * (1.0 + ramp[1:]), 2.0 * ramp_s + waits])
    # straight or held voltages and the kernels' own piecing allow a step from row to row
    simulator = Simulator(Drive.of_rows(time_s, path, linear=True), Bounds(math.inf, math.inf))
    try:
        reading = simulator.run(still).reading_um
    except ArithmeticError:
        return math.inf, True
    left = float(reading[-1] - reading[0])
    if abs(left) > MOST_PART * float(np.ptp(reading[: 2 * ROWS - 1])):
        return math.inf, True
    return left, abs(left) > LEAST_PART * float(np.ptp(reading))
