"""Rate-independent hysteresis beside a transducer that has none: w -> w + h.

    "plays"      h = sum_k p_k (F_k(v) - v), F_k the play of half-width r_k: what a play lags behind its voltage
    "bouc_wen"   h' = alpha v' - beta |v'| h - gamma v' |h|

Domain walls that jump from one pinning site to the next: the loop of h over v is the same at every speed, its area
grows with more than the square of the amplitude, and something stays at zero voltage (remanence). Ceramics show 10 %
to 15 % of the span; the paper's actuator shows a loop of at most 8.8 %.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..parabola import turning_point
from ..parameter import ModelError, check, parameter
from .bouc_wen import along
from .prandtl_ishlinskii import first_engagement, play

if TYPE_CHECKING:
    from ..composite_beam import CompositeBeam

ID = "rate_independent_hysteresis"
STAGE = "material"
TITLE = "Rate-independent hysteresis"
MEMORY = True
BESIDE = "voltage"
FORMS = ("plays", "bouc_wen")

_Constants = tuple[tuple[float, ...], tuple[float, ...], float, float, float]


@dataclass(frozen=True, slots=True)
class Parameters:
    """Plays, or the coefficients of Bouc-Wen; what the form does not use stays neutral."""

    form: str = "plays"
    thresholds_V: tuple[float, ...] = parameter((), unit="V", low=0.0, high=1e4, text="r_k, half-width of each play")
    weights_um_per_V: tuple[float, ...] = parameter(
        (), unit="um/V", low=-1e4, high=1e4, text="p_k, weight of each play", tunable=True
    )
    alpha_um_per_V: float = parameter(
        0.0, unit="um/V", low=-1e4, high=1e4, text="alpha, initial slope of h", tunable=True
    )
    beta_1_per_V: float = parameter(0.0, unit="1/V", low=0.0, high=1e4, text="beta", tunable=True)
    gamma_1_per_V: float = parameter(
        0.0, unit="1/V", low=-1e4, high=1e4, text="gamma, not above beta in size", tunable=True
    )

    def __post_init__(self) -> None:
        check(self, ID)
        if self.form not in FORMS:
            raise ModelError(f"{ID}.form: found {self.form!r}, expected one of {FORMS}")
        if len(self.thresholds_V) != len(self.weights_um_per_V):
            found = f"{len(self.thresholds_V)} thresholds and {len(self.weights_um_per_V)} weights"
            raise ModelError(f"{ID}.weights_um_per_V: found {found}, expected as many of one as of the other")
        if abs(self.gamma_1_per_V) > self.beta_1_per_V:
            found = f"{self.gamma_1_per_V!r} beside beta = {self.beta_1_per_V!r}"
            raise ModelError(f"{ID}.gamma_1_per_V: found {found}, expected |gamma| <= beta: h grows without bound")


def constants(settings: Parameters, beam: "CompositeBeam | None") -> _Constants:
    """Return (all r_k, all p_k, alpha, beta, gamma); of the two forms the one not chosen is empty."""
    del beam
    if settings.form == "plays":
        return settings.thresholds_V, settings.weights_um_per_V, 0.0, 0.0, 0.0
    return (), (), settings.alpha_um_per_V, settings.beta_1_per_V, settings.gamma_1_per_V


def initial(constants: _Constants) -> tuple[float, ...]:
    """Return (h, last v, then every play) at rest."""
    return (0.0, 0.0) + (0.0,) * len(constants[0])


def corner(
    state: tuple[float, ...], constants: _Constants, h: float,
    w0: float, wm: float, w1: float, v0: float, vm: float, v1: float,
) -> float:  # fmt: skip
    """Return the fraction of the sub-step at which a play engages or the voltage turns, 1 for none."""
    del h, w0, wm, w1
    if len(constants[0]) > 0:
        return first_engagement(state[2:], constants[0], v0, vm, v1)
    return turning_point(v0, vm, v1)


def beside(
    state: tuple[float, ...], constants: _Constants, time_s: float, h: float,
    w0: float, wm: float, w1: float, v0: float, vm: float, v1: float,
) -> tuple[tuple[float, ...], float, float, float]:  # fmt: skip
    """Add the hysteretic part, advanced along last voltage -> v0 -> vm -> v1."""
    del time_s, h
    thresholds, weights, alpha, beta, gamma = constants
    start = along(state[0], v0 - state[1], alpha, beta, gamma, 1.0)
    middle = along(start, vm - v0, alpha, beta, gamma, 1.0)
    end = along(middle, v1 - vm, alpha, beta, gamma, 1.0)
    y0, ym, y1 = w0 + start, wm + middle, w1 + end
    after: list[float] = [end, v1]
    for k in range(len(thresholds)):
        r, p = thresholds[k], weights[k]
        x0 = play(state[2 + k], v0, r)
        xm = play(x0, vm, r)
        x1 = play(xm, v1, r)
        after.append(x1)
        y0 += p * (x0 - v0)
        ym += p * (xm - vm)
        y1 += p * (x1 - v1)
    return tuple(after), y0, ym, y1
