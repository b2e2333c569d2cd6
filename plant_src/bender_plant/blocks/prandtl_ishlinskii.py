"""The Prandtl-Ishlinskii operator: a sum of plays, rate-independent, with remanence.

    w = p_0 u + sum_k p_k F_k(u),     F_k the play of half-width r_k: F -> max(u - r_k, min(u + r_k, F))

(Brokate and Sprekels, Hysteresis and Phase Transitions, 1996, ch. 2; Kuhnen, European Journal of Control 9, 2003.)
Along a monotone stretch the play needs its end only, so a step of the voltage is no approximation. Thresholds grow;
with weights >= 0 minor loops are congruent and the work done in a cycle is never negative.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.play import first_engagement, play
from bender_plant.kernels.state import of_any_length
from bender_plant.parameter import ModelError, check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "prandtl_ishlinskii"
STAGE = "material"
TITLE = "Prandtl-Ishlinskii hysteresis"
TRANSDUCER = True
MEMORY = True
STATE_OF_ANY_LENGTH = True


@dataclass(frozen=True, slots=True)
class Parameters:
    """Weights and half-widths of the plays; the defaults are four plays with a loop of about a tenth of the span."""

    linear_gain_um_per_V: float = parameter(0.35, unit="um/V", text="p_0, the part without hysteresis", tunable=True)
    thresholds_V: tuple[float, ...] = parameter(
        (1.0, 3.0, 6.0, 10.0), unit="V", low=0.0, text="r_k, half-width of each play"
    )
    weights_um_per_V: tuple[float, ...] = parameter(
        (0.04, 0.03, 0.03, 0.02),
        unit="um/V",
        text="p_k, weight of each play",
        tunable=True,
    )

    def __post_init__(self) -> None:
        check(self, ID)
        if len(self.thresholds_V) != len(self.weights_um_per_V):
            found = f"{len(self.thresholds_V)} thresholds and {len(self.weights_um_per_V)} weights"
            raise ModelError(f"{ID}.weights_um_per_V: found {found}, expected the same number of each")
        if any(b <= a for a, b in zip(self.thresholds_V, self.thresholds_V[1:], strict=False)):
            raise ModelError(f"{ID}.thresholds_V: found {self.thresholds_V}, expected growing values")


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, tuple[float, ...], tuple[float, ...]]:
    """Return (p_0, all r_k, all p_k)."""
    del beam
    return settings.linear_gain_um_per_V, settings.thresholds_V, settings.weights_um_per_V


def initial(constants: tuple[float, tuple[float, ...], tuple[float, ...]]) -> tuple[float, ...]:
    """Return the plays at rest, as after demagnetisation."""
    return (0.0,) * len(constants[1])


def corner(
    state: tuple[float, ...],
    constants: tuple[float, tuple[float, ...], tuple[float, ...]],
    h: float,
    u0: float,
    um: float,
    u1: float,
) -> float:
    """Return the fraction of the sub-step at which a play engages or the voltage turns, 1 for none."""
    del h
    return first_engagement(state, constants[1], u0, um, u1)


def step(
    state: tuple[float, ...],
    constants: tuple[float, tuple[float, ...], tuple[float, ...]],
    time_s: float,
    h: float,
    u0: float,
    um: float,
    u1: float,
) -> tuple[tuple[float, ...], float, float, float]:
    """Advance the plays along last voltage -> u0 -> um -> u1."""
    del time_s, h
    linear, thresholds, weights = constants
    y0, ym, y1 = linear * u0, linear * um, linear * u1
    after: list[float] = []
    for k in range(len(thresholds)):
        r, p = thresholds[k], weights[k]
        start = play(state[k], u0, r)
        middle = play(start, um, r)
        end = play(middle, u1, r)
        after.append(end)
        y0 += p * start
        ym += p * middle
        y1 += p * end
    return of_any_length(after), y0, ym, y1
