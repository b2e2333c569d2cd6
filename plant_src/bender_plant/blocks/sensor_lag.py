"""A sensor that follows with a first-order lag, tau r' = y - r.

The filter of an amplifier, the smoothing of a tracker, a long exposure. tau = 0 is no lag. What follows has a further
lag, as a rule, quicker by far: an amplifier behind the filter, a filter behind the amplifier. With a share k of tau

    tau s' = y - s,    k tau r' = s - r
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.first_order_lag import two_lags_step
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "sensor_lag"
STAGE = "sensor"
TITLE = "Sensor lag"
MEMORY = True


@dataclass(frozen=True, slots=True)
class Parameters:
    """The lag of the reading behind the tip, and a further one behind that."""

    time_constant_s: float = parameter(
        0.0, unit="s", low=0.0, high=1e6, text="time constant of the sensor, 0 for none", tunable=True
    )

    second_share: float = parameter(
        0.0, unit="1", low=0.0, high=1.0, text="k, time constant of a second lag over the first, 0 for none"
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (tau, k tau) in s."""
    del beam
    return settings.time_constant_s, settings.second_share * settings.time_constant_s


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (s, r) at rest."""
    del constants
    return 0.0, 0.0


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the first sub-step after a jump, short enough for the exponential to pass for a parabola."""
    del beam
    tau = settings.time_constant_s
    return (0.05 * tau if tau > 0.0 else math.inf), math.inf


def step(
    state: tuple[float, ...],
    constants: tuple[float, ...],
    time_s: float,
    h: float,
    y0: float,
    ym: float,
    y1: float,
) -> tuple[tuple[float, ...], float, float, float]:
    """Advance the reading over one sub-step."""
    del time_s
    first, second, start, middle, end = two_lags_step(state[0], state[1], constants[0], constants[1], h, y0, ym, y1)
    return (first, second), start, middle, end
