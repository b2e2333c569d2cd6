"""What a loop makes of measurement noise and of a load, on the sampled linear model."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_loop.control import pid
from bender_loop.control.pid import UNLIMITED, Gains, PidState
from bender_tuner.model.loop_transfer import DelayedPlant, is_stable
from bender_tuner.model.sampled_model import SampledModel

_PERIODS_AFTER_RESPONSE = 50


@dataclass(frozen=True, slots=True)
class LoadRejection:
    """The answer to a voltage of 1 V that is added to the command from one instant on.

    Attributes:
        integrated_error_um_s_per_V: integral of the displacement from the setpoint, 1/Ki; inf without an integral.
        peak_um_per_V: its largest magnitude.
        peak_time_s: when that is.
    """

    integrated_error_um_s_per_V: float
    peak_um_per_V: float
    peak_time_s: float


UNREJECTED = LoadRejection(math.inf, math.inf, math.nan)


def noise_gain_V_per_um(gains: Gains, plant: DelayedPlant) -> float:
    """Standard deviation of the command per standard deviation of white measurement noise; inf if unstable.

    The H2 norm of C S: the mean of |C S|^2 over the unit circle, by the trapezoidal rule on the uniform grid.
    """
    if not is_stable(gains, plant):
        return math.inf
    density = np.abs(plant.controller(gains) / (1.0 + plant.loop(gains)))[plant.uniform_start :] ** 2
    ends = 0.5 * (density[0] + density[-1])
    return float(np.sqrt((ends + np.sum(density[:-1])) / plant.intervals))


def load_rejection(gains: Gains, plant: DelayedPlant) -> LoadRejection:
    """The answer to a unit load; every figure inf for an unstable loop."""
    if not is_stable(gains, plant):
        return UNREJECTED
    count = plant.model.pulse_um_per_V.size + plant.latency_frames + _PERIODS_AFTER_RESPONSE
    displacement = np.abs(load_response(gains, plant.model, plant.latency_frames, count))
    peak = int(np.argmax(displacement))
    integral = gains.integral_V_per_um_s
    return LoadRejection(
        integrated_error_um_s_per_V=1.0 / integral if integral > 0.0 else math.inf,
        peak_um_per_V=float(displacement[peak]),
        peak_time_s=peak * plant.model.period_s,
    )


def load_response(gains: Gains, model: SampledModel, latency_frames: int, count: int) -> NDArray[np.float64]:
    """Displacement in um at samples 0..count-1, shape (count,), with a load of 1 V from sample 0 on.

    The PID block itself runs against the pulse response, without limits.
    """
    period = model.period_s
    pulse = np.diff(model.step_response(count + 1))[::-1]
    inputs = np.zeros(count)
    displacement = np.zeros(count)
    state = PidState()
    for k in range(count):
        displacement[k] = float(pulse[count - k :] @ inputs[:k])
        measured = float(displacement[max(k - latency_frames, 0)])
        state, command = pid.step(gains, UNLIMITED, state, 0.0, measured, period)
        inputs[k] = command + 1.0
    return displacement
