"""The damping of the bending modes is another than modelled.

Air, the clamp and the loss of the polymer together give 0.5 % to 10 %.
"""

from dataclasses import dataclass, replace

from bender_plant.blocks.bending_modes import Parameters as Modes
from bender_plant.parameter import check, parameter

ID = "structural_damping"
STAGE = "structure"
TITLE = "Another damping"


@dataclass(frozen=True, slots=True)
class Parameters:
    """The damping ratio."""

    damping_ratio: float = parameter(
        0.02, unit="1", low=1e-6, high=0.95, text="damping ratio of the bending modes", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def modify(settings: Parameters, modes: Modes) -> Modes:
    """Return the bending modes with this damping ratio."""
    return replace(modes, damping_ratio=settings.damping_ratio)
