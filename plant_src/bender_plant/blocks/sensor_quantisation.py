"""Coarse readings: r -> q round(r / q).

One pixel of the camera where the tip is not found between pixels (0.70 um in the paper's figure 8), one step of a
converter. Noise before the rounding is not part of the model. q = 0 is no rounding.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.rounding import rounded
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "sensor_quantisation"
STAGE = "sensor"
TITLE = "Steps of the sensor"
MEMORY = False


@dataclass(frozen=True, slots=True)
class Parameters:
    """The step of the readings."""

    step_um: float = parameter(0.0, unit="um", low=0.0, text="q, step of the readings, 0 for none", tunable=True)

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (q,) in um."""
    del beam
    return (settings.step_um,)


def step(
    state: tuple[float, ...],
    constants: tuple[float, ...],
    time_s: float,
    h: float,
    r0: float,
    rm: float,
    r1: float,
) -> tuple[tuple[float, ...], float, float, float]:
    """Round the reading."""
    del time_s, h
    q = constants[0]
    return state, rounded(r0, q), rounded(rm, q), rounded(r1, q)
