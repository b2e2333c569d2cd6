"""The four sensitivity functions of a loop, and what of its frequencies a picture shows.

S = 1/(1 + L) is what remains of a disturbance of the reading, T = L/(1 + L) what the tip makes of the setpoint and of
noise, GS what a volt of load moves, CS the command for a micrometre of noise (Astrom and Murray, Feedback Systems,
2nd ed., section 12.1: the gang of four).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bender_loop.control.pid import Gains
from bender_tuner.model.loop_transfer import DelayedPlant

_DECADES_BELOW = 2.5
"""How far below half the sampling frequency a loop without a crossover is shown."""
_DECADES_BELOW_CROSSOVER = 1.5

Response = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivities:
    """Frequency responses of one loop; all of the same shape (N,).

    Attributes:
        frequency_Hz: ascending, up to half the sampling frequency.
        loop: L.
        sensitivity: S.
        complementary: T.
        load_um_per_V: GS, from a load on the command to the reading.
        control_V_per_um: CS, from the noise of the reading to the command, its sign left out.
    """

    frequency_Hz: NDArray[np.float64]
    loop: Response
    sensitivity: Response
    complementary: Response
    load_um_per_V: Response
    control_V_per_um: Response


def sensitivities(gains: Gains, plant: DelayedPlant) -> Sensitivities:
    """Return the responses of `gains` around `plant` on the plant's grid; they mean nothing for an unstable loop."""
    loop = plant.loop(gains)
    sensitivity = 1.0 / (1.0 + loop)
    return Sensitivities(
        frequency_Hz=plant.omega_rad_per_s / (2.0 * math.pi),
        loop=loop,
        sensitivity=sensitivity,
        complementary=loop * sensitivity,
        load_um_per_V=plant.response_um_per_V * sensitivity,
        control_V_per_um=plant.controller(gains) * sensitivity,
    )


def lowest_drawn_Hz(plant: DelayedPlant, crossover_rad_per_s: float) -> float:
    """Return the lowest frequency that a picture of the loop needs: well below its crossover, NaN for none."""
    if math.isfinite(crossover_rad_per_s):
        return crossover_rad_per_s / (2.0 * math.pi) / 10.0**_DECADES_BELOW_CROSSOVER
    return plant.nyquist_rad_per_s / (2.0 * math.pi) / 10.0**_DECADES_BELOW
