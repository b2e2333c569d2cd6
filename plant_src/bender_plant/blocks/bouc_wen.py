"""The Bouc-Wen model, rate-independent hysteresis with remanence.

    w = d u + h,      h' = alpha u' - beta |u'| |h|^(n-1) h - gamma u' |h|^n

(Wen, Journal of the Engineering Mechanics Division 102, 1976; Low and Guo, IEEE Transactions on Robotics and
Automation 11, 1995, with alpha < 0 for the lag behind d u.) The paper prints the last term of equation (20) as
-gamma u', which leaves alpha and gamma inseparable: `printed = true` keeps that variant.

Time drops out: with s the direction and sigma the sign of h,

    dh/du = alpha - (beta s sigma + gamma) |h|^n

so the model advances along the path of the voltage, and a step of the voltage is a stretch of that path. For n = 1
each stretch of one sign is an exponential; other exponents are integrated by Runge-Kutta along the voltage.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bender_plant.kernels.bouc_wen import along
from bender_plant.parabola import turning_point
from bender_plant.parameter import ModelError, check, parameter

if TYPE_CHECKING:
    from bender_plant.composite_beam import CompositeBeam

ID = "bouc_wen"
STAGE = "material"
TITLE = "Bouc-Wen hysteresis"
TRANSDUCER = True
MEMORY = True


@dataclass(frozen=True, slots=True)
class Parameters:
    """Coefficients of the model; the defaults give a loop of about a tenth of the span at 50 V."""

    linear_gain_um_per_V: float = parameter(0.5, unit="um/V", text="d, the part without hysteresis", tunable=True)
    alpha_um_per_V: float = parameter(
        -0.2,
        unit="um/V",
        text="alpha, initial slope of the hysteretic part",
        tunable=True,
    )
    beta_1_per_V: float = parameter(0.1, unit="1/V", low=0.0, text="beta, in V^-1 um^(1-n)", tunable=True)
    gamma_1_per_V: float = parameter(
        0.05,
        unit="1/V",
        text="gamma, in V^-1 um^(1-n), not above beta in size",
        tunable=True,
    )
    exponent: float = parameter(1.0, unit="1", low=1.0, high=20.0, text="n, sharpness of the knee")
    printed: bool = False

    def __post_init__(self) -> None:
        check(self, ID)
        if not self.printed and abs(self.gamma_1_per_V) > self.beta_1_per_V:
            found = f"{self.gamma_1_per_V!r} beside beta = {self.beta_1_per_V!r}"
            raise ModelError(f"{ID}.gamma_1_per_V: found {found}, expected |gamma| <= beta: h grows without bound")


def constants(settings: Parameters, beam: "CompositeBeam | None") -> tuple[float, ...]:
    """Return (d, alpha, beta, gamma, n) of the equation in force."""
    del beam
    alpha, gamma = settings.alpha_um_per_V, settings.gamma_1_per_V
    if settings.printed:
        alpha, gamma = alpha - gamma, 0.0
    return settings.linear_gain_um_per_V, alpha, settings.beta_1_per_V, gamma, settings.exponent


def initial(constants: tuple[float, ...]) -> tuple[float, ...]:
    """Return (h, last u) at rest."""
    del constants
    return (0.0, 0.0)


def corner(state: tuple[float, ...], constants: tuple[float, ...], h: float, u0: float, um: float, u1: float) -> float:
    """Return the fraction of the sub-step at which the voltage turns, 1 where it does not."""
    del state, constants, h
    return turning_point(u0, um, u1)


def step(
    state: tuple[float, ...],
    constants: tuple[float, ...],
    time_s: float,
    h: float,
    u0: float,
    um: float,
    u1: float,
) -> tuple[tuple[float, ...], float, float, float]:
    """Advance along last voltage -> u0 -> um -> u1."""
    del time_s, h
    d, alpha, beta, gamma, n = constants
    start = along(state[0], u0 - state[1], alpha, beta, gamma, n)
    middle = along(start, um - u0, alpha, beta, gamma, n)
    end = along(middle, u1 - um, alpha, beta, gamma, n)
    return (end, u1), d * u0 + start, d * um + middle, d * u1 + end
