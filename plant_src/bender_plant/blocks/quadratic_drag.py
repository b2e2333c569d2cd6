"""Drag with the square of the speed, on the first mode: q'' + 2 zeta omega q' + d q' |q'| + omega^2 (q - w) = 0.

A body in a fluid at high Reynolds number, a damper with an orifice, a float. Large ringing dies fast and small ringing
slowly. d = 0 is none.
"""

from dataclasses import dataclass

from bender_plant.blocks.bending_modes import Parameters as Modes
from bender_plant.parameter import check, parameter

ID = "quadratic_drag"
STAGE = "structure"
TITLE = "Quadratic drag"


@dataclass(frozen=True, slots=True)
class Parameters:
    """The coefficient of the drag."""

    drag_1_per_um: float = parameter(
        0.0, unit="1/um", low=0.0, text="d, drag over mass and squared speed", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def modify(settings: Parameters, modes: Modes) -> Modes:
    """Return the bending modes with drag on the first."""
    return modes.loaded(drag_1_per_um=settings.drag_1_per_um)
