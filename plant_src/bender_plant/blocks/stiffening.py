"""Stiffening: the restoring force of the first mode grows with the cube of its displacement.

    q'' + 2 zeta omega q' + omega^2 (q + k_3 (q^3 + 3 q_0 q^2) - w) = 0

The frequency rises with the amplitude (k_3 > 0) and the static gain falls. A spring whose symmetric place is not its
rest, but q_0 below it, has a square as well: of k_3 ((q + q_0)^3 - q_0^3) the linear part is in omega. For a cantilever
the geometric effect is of the order (q / L)^2, 6e-6 here: a large k_3 points to a stop, a wire that tightens or a clamp
that rolls. None of them is a pure cubic far from rest. Its coefficient bends there, by b:

    b > 0   k_3 / (1 + b q^2)             a spring that levels off
    b < 0   k_3 sqrt(1 + 2 |b| q^2)       one that tightens further
"""

from dataclasses import dataclass, replace

from bender_plant.blocks.bending_modes import Parameters as Modes
from bender_plant.parameter import check, parameter

ID = "stiffening"
STAGE = "structure"
TITLE = "Stiffening"


@dataclass(frozen=True, slots=True)
class Parameters:
    """The cubic coefficient, where the spring is symmetric, and how the coefficient bends."""

    cubic_1_per_um2: float = parameter(0.0, unit="1/um2", text="k_3, of either sign", tunable=True)
    preload_um: float = parameter(
        0.0, unit="um", text="q_0, rest above the symmetric place of the spring", tunable=True
    )
    bending_1_per_um2: float = parameter(0.0, unit="1/um2", text="b, how k_3 bends far from rest", tunable=True)

    def __post_init__(self) -> None:
        check(self, ID)


def modify(settings: Parameters, modes: Modes) -> Modes:
    """Return the bending modes with the cubic force, and the square of a preloaded one, in the first.

    The square of a preloaded spring does not bend.
    """
    cubic = replace(modes, cubic_1_per_um2=settings.cubic_1_per_um2)
    square = 3.0 * settings.cubic_1_per_um2 * settings.preload_um
    loads = {"quadratic_1_per_um": modes.quadratic_1_per_um + square, "bending_1_per_um2": settings.bending_1_per_um2}
    return cubic.loaded(**loads)
