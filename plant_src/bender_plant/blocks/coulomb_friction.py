"""Dry friction on the first mode, with Stribeck's fall from rest to motion.

    q'' + 2 zeta omega q' + omega^2 (q + f(q') - w) = 0
    f = sign(q') (f_c + (f_s - f_c) exp(-(q' / v_s)^2)) in motion; at rest whatever holds it, up to f_s

f is a force over the stiffness, a displacement: the spring is held back by it, and rests anywhere within it. A guide, a
seal, a bearing, a loaded screw. f_s = ratio f_c; a ratio of 1 is Coulomb's law. f_c = 0 is none.
"""

from dataclasses import dataclass

from bender_plant.blocks.bending_modes import Parameters as Modes
from bender_plant.parameter import check, parameter

ID = "coulomb_friction"
STAGE = "structure"
TITLE = "Dry friction"


@dataclass(frozen=True, slots=True)
class Parameters:
    """The friction in motion, and how much more holds at rest."""

    level_um: float = parameter(
        0.0, unit="um", low=0.0, text="f_c, friction in motion over the stiffness", tunable=True
    )
    breakaway_ratio: float = parameter(
        1.0, unit="1", low=1.0, high=100.0, text="f_s over f_c, of rest and of motion", tunable=True
    )
    stribeck_um_per_s: float = parameter(
        100.0, unit="um/s", low=1e-30, text="v_s, speed over which f_s falls to f_c", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)


def modify(settings: Parameters, modes: Modes) -> Modes:
    """Return the bending modes with friction on the first."""
    level = settings.level_um
    return modes.loaded(
        friction_um=level,
        breakaway_um=settings.breakaway_ratio * level,
        stribeck_um_per_s=settings.stribeck_um_per_s,
    )
