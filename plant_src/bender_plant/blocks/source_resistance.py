"""A first-order supply: source resistance and the capacitance behind it, tau v' = v_c - v.

With 0.88 nF a megohm gives 0.9 ms; a laboratory supply that follows its set-point in 20 ms is the same equation. A
parabola of v_c over the sub-step is answered exactly; tau = 0 is no supply lag. A cable or a filter between both makes
a ladder of it. With a share k of tau

    tau s' = v_c - s,    k tau v' = s - v
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.first_order_lag import two_lags_step
from bender_plant.parameter import check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "source_resistance"
STAGE = "supply"
TITLE = "Source resistance"
MEMORY = True


@dataclass(frozen=True, slots=True)
class Parameters:
    """The lag of the electrode voltage behind the command, and a further one behind that."""

    time_constant_s: float = parameter(
        0.0, unit="s", low=0.0, high=1e6, text="resistance times capacitance, 0 for none", tunable=True
    )

    second_share: float = parameter(
        0.0, unit="1", low=0.0, high=1.0, text="k, time constant of a second lag over the first, 0 for none"
    )

    def __post_init__(self) -> None:
        check(self, ID)


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (tau, k tau) in s."""
    del beam
    return settings.time_constant_s, settings.second_share * settings.time_constant_s


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (s, v) at rest."""
    del constants
    return 0.0, 0.0


def longest_step_s(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, float]:
    """Return the first sub-step after a jump, short enough for the exponentials to pass for a parabola.

    What a second lag delays by less than a hundredth of the first moves nothing that is read.
    """
    del beam
    tau, share = settings.time_constant_s, settings.second_share
    part = min(0.05, max(0.3 * share, 0.01)) if share > 0.0 else 0.05
    return (part * tau if tau > 0.0 else math.inf), math.inf


def step(
    state: tuple[float, ...],
    constants: tuple[float, ...],
    time_s: float,
    h: float,
    u0: float,
    um: float,
    u1: float,
) -> tuple[tuple[float, ...], float, float, float]:
    """Advance the electrode voltage over one sub-step."""
    del time_s
    first, second, start, middle, end = two_lags_step(state[0], state[1], constants[0], constants[1], h, u0, um, u1)
    return (first, second), start, middle, end
