"""Hysteresis in the restoring force of the first mode, a Bouc-Wen spring beside the linear one.

    q'' + 2 zeta omega q' + omega^2 (q + z - w) = 0,      z' = alpha q' - beta |q'| z - gamma q' |z|

Joints that slip a little, wire ropes, rubber, soil: the loop is one of force over displacement, so it damps the ringing
and moves the resonance with the amplitude. z ends at alpha / (beta + gamma). alpha = 0 is none.
(Wen, Journal of the Engineering Mechanics Division 102, 1976.)
"""

from dataclasses import dataclass

from bender_plant.blocks.bending_modes import Parameters as Modes
from bender_plant.parameter import ModelError, check, parameter

ID = "hysteretic_spring"
STAGE = "structure"
TITLE = "Hysteretic spring"


@dataclass(frozen=True, slots=True)
class Parameters:
    """Share, and how soon it yields."""

    share: float = parameter(
        0.0,
        unit="1",
        low=0.0,
        high=1e3,
        text="alpha, stiffness of the hysteretic part over the linear",
        tunable=True,
    )
    beta_1_per_um: float = parameter(1.0, unit="1/um", low=0.0, high=1e6, text="beta", tunable=True)
    gamma_1_per_um: float = parameter(
        0.0, unit="1/um", low=-1e6, high=1e6, text="gamma, not above beta in size", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)
        if abs(self.gamma_1_per_um) > self.beta_1_per_um:
            found = f"{self.gamma_1_per_um!r} beside beta = {self.beta_1_per_um!r}"
            raise ModelError(f"{ID}.gamma_1_per_um: found {found}, expected |gamma| <= beta: z grows without bound")


def modify(settings: Parameters, modes: Modes) -> Modes:
    """Return the bending modes with a hysteretic force on the first."""
    return modes.loaded(
        hysteresis_share=settings.share,
        hysteresis_beta_1_per_um=settings.beta_1_per_um,
        hysteresis_gamma_1_per_um=settings.gamma_1_per_um,
    )
