"""One set of gains in the forms that other controllers expect.

Parallel (ours):  u = Kp e + Ki int(e) + Kd de/dt
ISA:              u = Kc (e + 1/Ti int(e) + Td de/dt),  Kc = Kp, Ti = Kp / Ki, Td = Kd / Kp
Discrete:         u[k] = -a1 u[k-1] - a2 u[k-2] + sum_i r_i setpoint[k-i] - sum_i m_i measurement[k-i]

Sources: Astrom and Hagglund, Advanced PID Control, ISA 2006, section 3.4 (ISA form) and chapter 13 (discretisation).
The discrete form is `bender_loop.control.pid.step` away from the limits, multiplied out.
"""

import math
from dataclasses import dataclass

from bender_loop.control.pid import Gains


@dataclass(frozen=True, slots=True)
class IsaForm:
    """The standard form with times instead of gains; a missing integral is an infinite `integral_time_s`."""

    gain_V_per_um: float
    integral_time_s: float
    derivative_time_s: float
    filter_time_s: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.gain_V_per_um) and self.gain_V_per_um > 0.0):
            raise ValueError(f"gain_V_per_um must be a finite number > 0, found {self.gain_V_per_um!r}")
        if not self.integral_time_s > 0.0:
            raise ValueError(f"integral_time_s must be > 0 (inf for none), found {self.integral_time_s!r}")
        for name in ("derivative_time_s", "filter_time_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must be a finite number >= 0, found {value!r}")


@dataclass(frozen=True, slots=True)
class DiscreteForm:
    """Coefficients of the difference equation at one sampling period, newest sample first.

    Attributes:
        period_s: the sampling period they hold for.
        denominator: (1, a1, a2), without unit.
        setpoint_V_per_um: (r0, r1, r2).
        measurement_V_per_um: (m0, m1, m2); equal to the setpoint's where the derivative acts on the error.
    """

    period_s: float
    denominator: tuple[float, float, float]
    setpoint_V_per_um: tuple[float, float, float]
    measurement_V_per_um: tuple[float, float, float]


def to_isa(gains: Gains) -> IsaForm | None:
    """The ISA form, or None where there is none: it has no place for I or D without P."""
    proportional = gains.proportional_V_per_um
    if proportional == 0.0:
        return None
    integral = gains.integral_V_per_um_s
    return IsaForm(
        gain_V_per_um=proportional,
        integral_time_s=proportional / integral if integral > 0.0 else math.inf,
        derivative_time_s=gains.derivative_V_s_per_um / proportional,
        filter_time_s=gains.filter_time_s,
    )


def from_isa(form: IsaForm, *, derivative_on_error: bool = False) -> Gains:
    """The parallel gains of an ISA form."""
    return Gains(
        proportional_V_per_um=form.gain_V_per_um,
        integral_V_per_um_s=form.gain_V_per_um / form.integral_time_s,
        derivative_V_s_per_um=form.gain_V_per_um * form.derivative_time_s,
        filter_time_s=form.filter_time_s,
        derivative_on_error=derivative_on_error,
    )


def to_discrete(gains: Gains, period_s: float) -> DiscreteForm:
    """The difference equation at `period_s`; ValueError where the period is not a positive number."""
    if not (math.isfinite(period_s) and period_s > 0.0):
        raise ValueError(f"period_s must be a finite number > 0, found {period_s!r}")
    pole = gains.filter_time_s / (gains.filter_time_s + period_s)
    slope = gains.derivative_V_s_per_um / (gains.filter_time_s + period_s)
    proportional = gains.proportional_V_per_um
    summed = gains.integral_V_per_um_s * period_s
    without_derivative = (
        proportional + summed,
        -proportional * (1.0 + pole) - summed * pole,
        proportional * pole,
    )
    second_difference = (slope, -2.0 * slope, slope)
    measurement = _add(without_derivative, second_difference)
    return DiscreteForm(
        period_s=period_s,
        denominator=(1.0, -(1.0 + pole), pole),
        setpoint_V_per_um=measurement if gains.derivative_on_error else without_derivative,
        measurement_V_per_um=measurement,
    )


def _add(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
