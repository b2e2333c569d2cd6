"""The output terminals of a one-quadrant supply, in steps of time.

Upwards the output capacitor is charged by the current limit (a low limit makes a slow rise: C dv/dt = I) and no
faster than the slew. Downwards the supply cannot pull: the load and a bleeder discharge the capacitor with a time
constant, slower with the output switched off.
"""

import math
from dataclasses import dataclass

from bender_loop.bounds import check_numbers

_BOUNDS = {
    "slew_V_per_s": (1e-3, 1e9),
    "capacitance_F": (1e-15, 1.0),
    "fall_time_s": (1e-9, 1e3),
    "off_fall_time_s": (1e-9, 1e3),
    "noise_V": (0.0, 1e3),
    "noise_A": (0.0, 1e3),
}


@dataclass(frozen=True, slots=True)
class TerminalSettings:
    """Constants of the output.

    Attributes:
        slew_V_per_s: fastest rise of the regulator.
        capacitance_F: of the output capacitor and the actuator.
        fall_time_s: time constant of the way down while on.
        off_fall_time_s: the same while off.
        noise_V: standard deviation of a measured voltage.
        noise_A: standard deviation of a measured current.

    Raises:
        ValueError: a value is no number or out of its bounds.
    """

    slew_V_per_s: float = 5000.0
    capacitance_F: float = 5e-6
    fall_time_s: float = 0.0005
    off_fall_time_s: float = 0.1
    noise_V: float = 0.004
    noise_A: float = 2e-5

    def __post_init__(self) -> None:
        check_numbers(self, _BOUNDS)


def step(
    settings: TerminalSettings, output_V: float, target_V: float, limit_A: float, is_on: bool, dt_s: float
) -> tuple[float, float]:
    """Advance the output by `dt_s`; returns (output_V, current_A) at the end."""
    wanted_V = target_V if is_on else 0.0
    if wanted_V >= output_V:
        change_V = min(wanted_V - output_V, settings.slew_V_per_s * dt_s, limit_A / settings.capacitance_F * dt_s)
    else:
        time_s = settings.fall_time_s if is_on else settings.off_fall_time_s
        change_V = (wanted_V - output_V) * -math.expm1(-dt_s / time_s)
    return output_V + change_V, max(0.0, settings.capacitance_F * change_V / dt_s)
