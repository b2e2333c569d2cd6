"""A spring that is stiffer one way than the other: a restoring force with a square of the displacement.

    q'' + 2 zeta omega q' + omega^2 (q + k_2 q^2 - w) = 0

A preloaded contact, a diaphragm that bulges, an electrostatic gap, a transistor in an electronic oscillator. k_2 > 0
stiffens towards positive displacements and softens the other way, where q + k_2 q^2 has an end at q = -1 / (2 k_2).
"""

from dataclasses import dataclass

from bender_plant.blocks.bending_modes import Parameters as Modes
from bender_plant.parameter import check, parameter

ID = "quadratic_spring"
STAGE = "structure"
TITLE = "Asymmetric spring"


@dataclass(frozen=True, slots=True)
class Parameters:
    """The quadratic coefficient."""

    quadratic_1_per_um: float = parameter(0.0, unit="1/um", text="k_2, of either sign", tunable=True)

    def __post_init__(self) -> None:
        check(self, ID)


def modify(settings: Parameters, modes: Modes) -> Modes:
    """Return the bending modes with the quadratic force in the first, beside that of a preloaded spring."""
    return modes.loaded(quadratic_1_per_um=modes.quadratic_1_per_um + settings.quadratic_1_per_um)
