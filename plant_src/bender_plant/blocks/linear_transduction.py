"""Linear transduction: the static displacement of the beam, w = k_b S u.

S is the static gain of the composite beam (um/V, `composite_beam.static_gain_um_per_V`), or a measured one that the
model gives; k_b closes the distance to a measured actuator (glue, electrodes, a piezoelectric coefficient below the
sheet's): the paper's is 0.41.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.composite_beam import static_gain_um_per_V
from bender_plant.parameter import ModelError, check, check_given, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "linear_transduction"
STAGE = "material"
TITLE = "Linear transduction of the composite beam"
TRANSDUCER = True
MEMORY = False
MOST_um_per_V = 1e12
"""Other devices may read metres, or pascals called um; more is a slip of the unit."""


@dataclass(frozen=True, slots=True)
class Parameters:
    """How much of the calculated sensitivity is there; `sensitivity_um_per_V` takes the place of the calculated one."""

    gain_factor: float = parameter(
        1.0, unit="1", low=-1e3, high=1e3, text="measured over calculated static sensitivity", tunable=True
    )
    sensitivity_um_per_V: float | None = None

    def __post_init__(self) -> None:
        check(self, ID)
        check_given(self.sensitivity_um_per_V, "um/V", -MOST_um_per_V, MOST_um_per_V, f"{ID}.sensitivity_um_per_V")


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (k_b S,) in um/V."""
    if settings.sensitivity_um_per_V is not None:
        return (settings.gain_factor * settings.sensitivity_um_per_V,)
    if beam is None:
        raise ModelError(
            f"{ID}: found no [beam] in the model, expected one to take the sensitivity from, or sensitivity_um_per_V"
        )
    return (settings.gain_factor * static_gain_um_per_V(beam),)


def step(
    state: tuple[float, ...],
    constants: tuple[float, ...],
    time_s: float,
    h: float,
    u0: float,
    um: float,
    u1: float,
) -> tuple[tuple[float, ...], float, float, float]:
    """Return the input times the sensitivity."""
    del time_s, h
    gain = constants[0]
    return state, gain * u0, gain * um, gain * u1
