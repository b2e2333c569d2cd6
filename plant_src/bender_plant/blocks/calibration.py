"""The reading's scale and zero, r -> gain r + offset: microns per pixel, and where the ruler begins."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "calibration"
STAGE = "sensor"
TITLE = "Calibration of the reading"
MEMORY = False


@dataclass(frozen=True, slots=True)
class Parameters:
    """Neutral at gain 1 and offset 0."""

    gain: float = parameter(1.0, unit="1", low=-1e4, high=1e4, text="factor on the reading", tunable=True)
    offset_um: float = parameter(0.0, unit="um", text="constant added to the reading", tunable=True)

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (gain, offset in um)."""
    del beam
    return (settings.gain, settings.offset_um)


def step(
    state: tuple[float, ...],
    constants: tuple[float, ...],
    time_s: float,
    h: float,
    r0: float,
    rm: float,
    r1: float,
) -> tuple[tuple[float, ...], float, float, float]:
    """Scale and shift the reading."""
    del time_s, h
    gain, offset = constants
    return state, gain * r0 + offset, gain * rm + offset, gain * r1 + offset
