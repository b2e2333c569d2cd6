"""The first resonance lies elsewhere than modelled: omega -> r omega, with the static gain as it was.

A mass at the tip lowers it, r = (1 + m_t / (0.243 m_b))^(-1/2); a stiffer clamp or layers that are left out raise it.
A wire of 15 um is below 0.1 % and cannot be seen; a drop of glue of 0.1 mg can.
"""

from dataclasses import dataclass, replace

from bender_plant.blocks.bending_modes import Parameters as Modes
from bender_plant.parameter import check, parameter

ID = "tip_mass"
STAGE = "structure"
TITLE = "Another first resonance"


@dataclass(frozen=True, slots=True)
class Parameters:
    """The ratio of the frequencies."""

    frequency_ratio: float = parameter(
        1.0, unit="1", low=0.1, high=10.0, text="first resonance over the modelled one", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def modify(settings: Parameters, modes: Modes) -> Modes:
    """Return the bending modes with their frequencies scaled."""
    return replace(modes, frequency_factor=modes.frequency_factor * settings.frequency_ratio)
