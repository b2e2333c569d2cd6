"""A bending mode above those of the model: y -> (1 - s) y + s q_2, q_2 driven by the quasi-static displacement.

    q_2'' + 2 zeta_2 omega_2 q_2' + omega_2^2 (q_2 - w) = 0

The second mode of a uniform cantilever lies at 6.267 times the first and carries 7.9 % of the static tip; the static
gain stays as it was.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.vibration_mode import mode_step
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "second_mode"
STAGE = "structure"
TITLE = "A second mode"
MEMORY = True
BESIDE = "quasi_static"


@dataclass(frozen=True, slots=True)
class Parameters:
    """Share, frequency and damping of the mode."""

    share: float = parameter(0.0, unit="1", low=-1.0, high=1.0, text="s, part of the static displacement", tunable=True)
    frequency_Hz: float = parameter(
        654.1, unit="Hz", low=1e-6, high=1e6, text="natural frequency of the mode", tunable=True
    )
    damping_ratio: float = parameter(
        0.02, unit="1", low=1e-6, high=0.95, text="damping ratio of the mode", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (omega in rad/s, zeta, s)."""
    del beam
    return 2.0 * math.pi * settings.frequency_Hz, settings.damping_ratio, settings.share


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (q_2, q_2') at rest."""
    del constants
    return (0.0, 0.0)


def ringing_step_s(settings: Parameters, beam: "CompositeBeam | None") -> float:
    """Return the longest sub-step over which the ringing of the mode passes for a parabola."""
    del beam
    return 0.2 / (2.0 * math.pi * settings.frequency_Hz)


def beside(
    state: tuple[float, ...], constants: tuple[float, ...], time_s: float, h: float,
    y0: float, ym: float, y1: float, w0: float, wm: float, w1: float,
) -> tuple[tuple[float, ...], float, float, float]:  # fmt: skip
    """Give the mode its share of the displacement."""
    del time_s
    omega, zeta, s = constants
    q0 = state[0]
    q, rate, middle = mode_step(q0, state[1], omega, zeta, h, w0, wm, w1)
    return (q, rate), y0 + s * (q0 - y0), ym + s * (middle - ym), y1 + s * (q - y1)
