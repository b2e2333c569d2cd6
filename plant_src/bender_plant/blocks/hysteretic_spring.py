"""Hysteresis in the restoring force of the first mode, a Bouc-Wen spring beside the linear one.

    q'' + 2 zeta omega q' + omega^2 (q + z - w) = 0,      z' = alpha q' - beta |q'| z - gamma q' |z|

Joints that slip a little, wire ropes, rubber, soil: the loop is one of force over displacement, so it damps the ringing
and moves the resonance with the amplitude. z ends at alpha / (beta + gamma). alpha = 0 is none.
(Wen, Journal of the Engineering Mechanics Division 102, 1976.)

With gamma < -beta the spring hardens: z has no end and is bounded because q is (Ismail, Ikhouane and Rodellar 2009,
doi:10.1007/s11831-009-9031-8); the published benchmark of Noel and Schoukens (2016) is such a spring.
"""

from dataclasses import dataclass

from bender_plant.blocks.bending_modes import Parameters as Modes
from bender_plant.parameter import ModelError, check, parameter

ID = "hysteretic_spring"
STAGE = "structure"
TITLE = "Hysteretic spring"
HARDEST = 2.0
"""Times beta: the most that a gamma below zero may be in size."""


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
    beta_1_per_um: float = parameter(1.0, unit="1/um", low=0.0, text="beta, how soon a branch levels off", tunable=True)
    gamma_1_per_um: float = parameter(0.0, unit="1/um", text="gamma, from -2 beta to beta", tunable=True)

    def __post_init__(self) -> None:
        check(self, ID)
        if not -HARDEST * self.beta_1_per_um <= self.gamma_1_per_um <= self.beta_1_per_um:
            found = f"{self.gamma_1_per_um!r} beside beta = {self.beta_1_per_um!r}"
            raise ModelError(f"{ID}.gamma_1_per_um: found {found}, expected -2 beta <= gamma <= beta")


def modify(settings: Parameters, modes: Modes) -> Modes:
    """Return the bending modes with a hysteretic force on the first."""
    return modes.loaded(
        hysteresis_share=settings.share,
        hysteresis_beta_1_per_um=settings.beta_1_per_um,
        hysteresis_gamma_1_per_um=settings.gamma_1_per_um,
    )
